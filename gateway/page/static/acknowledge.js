// Acknowledging alarms: by the button beside the standing alarm, by F8, or in the list of alerts.

import {setText} from "./facts.js";
import {post, reasonOf} from "./post.js";
import {hasText, text} from "./texts.js";
import {timeOfDay} from "./time.js";

const KEY = "F8";
const COMPLAINT_MS = 8000;
const UNAUTHORISED = 401;

// Return the incidents of alarms that nobody has acknowledged.
const waitingOf = (alarms) => alarms.filter((one) => one.incident && !one.acknowledged_by).map((one) => one.incident);

// Return the alarms that stand: warnings and limits.
export const standing = (alert) => (alert?.active ?? []).filter((one) => one.level === "warn" || one.level === "trip");

export class Acknowledger {
  constructor(person) {
    this.person = person;
    this.waiting = []; // incidents that stand and nobody has acknowledged
    this.listed = []; // those of them in the list that have ended
    this.names = new Map(); // of the listed alarms, by incident
    this.complaint = "";
    this.allButton = document.getElementById("acknowledge-all");
    this.allButton.addEventListener("click", () => this.acknowledge(this.listed));
    this.button = document.getElementById("acknowledge");
    this.button.addEventListener("click", () => this.acknowledge(this.waiting));
    document.addEventListener("keydown", (event) => {
      if (event.key !== KEY || this.button.hidden || this.person.dialog.open) return;
      event.preventDefault();
      this.acknowledge(this.waiting);
    });
  }

  // Show the button while an alarm stands that nobody has acknowledged, and else who has.
  show(alarms) {
    this.waiting = waitingOf(alarms);
    this.button.hidden = this.waiting.length === 0;
    setText("acknowledge-as", this.nameOf());
    const done = alarms.find((one) => one.acknowledged_by);
    const by = done && this.waiting.length === 0 ? acknowledgedText(done) : "";
    setText("acknowledged", this.complaint || by);
  }

  // Show how many alarms have ended without an acknowledgement, and offer to acknowledge several at once.
  list(alarms) {
    this.listed = waitingOf(alarms.filter((one) => one.until_ns !== null));
    this.names = new Map(alarms.map((one) => [one.incident, `${alarmName(one)} ${timeOfDay(one.since_ns).slice(0, 5)}`]));
    const count = this.listed.length;
    setText("alerts-waiting", count > 0 ? String(count) : "");
    setText("alerts-waiting-words", count > 0 ? text("alerts_waiting", {count}) : "");
    this.allButton.hidden = count < 2;
    const words = this.inNameOf("acknowledge_all");
    if (this.allButton.getAttribute("aria-label") !== words) {
      this.allButton.setAttribute("aria-label", words);
      this.allButton.title = words;
    }
  }

  // Return in whose name an alarm is acknowledged; empty where the dialog asks for it.
  nameOf() {
    return this.person.name === null ? "" : text("acknowledge_as", {name: this.person.name});
  }

  // Return the words of a button, and in whose name it acknowledges.
  inNameOf(key) {
    return `${text(key)} ${this.nameOf()}`.trim();
  }

  async acknowledge(incidents) {
    if (this.person.name === null) {
      this.ask(incidents);
      return;
    }
    for (const incident of incidents) {
      const answer = await post("api/acknowledge", {incident});
      if (answer.status === UNAUTHORISED) {
        this.person.name = null;
        this.ask(incidents);
        return;
      }
      if (!answer.ok) this.complain(reasonOf(answer));
    }
  }

  // Ask who it is that acknowledges, and say what.
  ask(incidents) {
    const what = incidents.length > 1 ? text("alarms", {count: incidents.length}) : this.names.get(incidents[0]);
    this.person.ask(() => this.acknowledge(incidents), what);
  }

  complain(reason) {
    this.complaint = text("not_done", {reason});
    setTimeout(() => { this.complaint = ""; }, COMPLAINT_MS);
  }
}

// Return what an alarm is of, and its level.
export const alarmName = ({rule, level}) => `${hasText(`rule_${rule}`) ? text(`rule_${rule}`) : rule}: ${text(`level_${level}`)}`;

// Return who acknowledged an alarm, and when.
export const acknowledgedText = ({acknowledged_by: name, acknowledged_ns: timeNs}) =>
  text("acknowledged_by", {name, time: timeNs === null ? "" : timeOfDay(timeNs).slice(0, 5)});
