// The list of alerts, newest first: from when to when, what, the largest value, the limit and whether it was reached, and who
// acknowledged it. Without a gateway nobody knows whether an alert lasts, nor can acknowledge it.

import {acknowledgedText, alarmName} from "./acknowledge.js";
import {degrees, isKnown} from "./number.js";
import {setText} from "./facts.js";
import {text} from "./texts.js";
import {timeOfDay} from "./time.js";

const CELLS = ["from", "to", "what", "largest", "limit", "by"];
const LABELLED = ["largest", "limit"]; // on a phone, which has no room for the head of the table

export class AlertList {
  constructor(body, acknowledger) {
    this.body = body;
    this.acknowledger = acknowledger;
    this.rows = new Map();
  }

  // Rows stay the same elements while their values change, so that a button under a finger stays there.
  show({since_ns: sinceNs, alerts}, gone) {
    this.gone = gone;
    const time = timeOfDay(sinceNs);
    setText("alerts-title", text("alerts_of", {time}));
    setText("alerts-none", alerts.length === 0 ? text("no_alerts", {time}) : "");
    this.acknowledger.list(alerts);
    const newestFirst = [...alerts].reverse();
    const rows = new Map(newestFirst.map((alert) => [keyOf(alert), this.rows.get(keyOf(alert)) ?? makeRow()]));
    const isNew = [...rows.keys()].join() !== [...this.rows.keys()].join();
    this.rows = rows;
    for (const alert of newestFirst) this.fill(rows.get(keyOf(alert)), alert);
    if (isNew) this.body.replaceChildren(...rows.values());
  }

  fill(row, alert) {
    const name = alarmName(alert);
    row.dataset.level = alert.level;
    row.classList.toggle("standing", alert.until_ns === null);
    const cells = [
      timeOfDay(alert.since_ns),
      alert.is_cut || (this.gone && alert.until_ns === null) ? text("never") : alert.until_ns === null ? text("alert_standing") : timeOfDay(alert.until_ns),
      name,
      largest(alert),
      limit(alert),
    ];
    cells.forEach((content, i) => {
      if (row.cells[i].textContent !== content) row.cells[i].textContent = content;
    });
    this.fillLast(row.cells[5], alert, name);
  }

  fillLast(cell, alert, name) {
    const waits = alert.acknowledged_by === null && alert.incident !== null && !this.gone;
    const by = waits ? "" : alert.acknowledged_by === null ? text("not_acknowledged") : acknowledgedText(alert);
    const words = this.acknowledger.inNameOf("acknowledge");
    const shown = JSON.stringify([by, waits, name, words]);
    if (cell.dataset.shown === shown) return;
    cell.dataset.shown = shown;
    cell.textContent = by;
    if (!waits) return;
    const button = Object.assign(document.createElement("button"), {type: "button", textContent: text("acknowledge")});
    button.setAttribute("aria-label", `${words}: ${name}, ${timeOfDay(alert.since_ns)}`);
    button.title = words;
    button.addEventListener("click", () => this.acknowledger.acknowledge([alert.incident]));
    cell.append(button);
  }
}

// Return the largest angle; of an alert that was not followed to its end a lower bound, where it says more than the limit does.
function largest({is_cut: isCut, largest_deg: largestDeg, limit_deg: limitDeg}) {
  if (!isCut || !isKnown(largestDeg)) return degrees(largestDeg);
  return isKnown(limitDeg) && largestDeg < limitDeg ? text("never") : `≥ ${degrees(largestDeg)}`;
}

// Return the limit of an alert, and why there was one below it; of one that was not followed to its end nobody knows.
function limit({is_corrected: isCorrected, is_cut: isCut, largest_deg: largestDeg, limit_deg: limitDeg}) {
  if (!isKnown(limitDeg)) return "";
  if (isCorrected) return text("limit_not_reached", {angle: degrees(limitDeg)});
  return isKnown(largestDeg) && largestDeg < limitDeg && !isCut ? text("limit_expected", {angle: degrees(limitDeg)}) : degrees(limitDeg);
}

const keyOf = (alert) => `${alert.incident ?? alert.rule} ${alert.since_ns}`;

function makeRow() {
  const row = document.createElement("tr");
  row.setAttribute("role", "row");
  row.append(...CELLS.map((className) => Object.assign(document.createElement("td"), {className, role: "cell"})));
  for (const name of LABELLED) row.querySelector(`.${name}`).dataset.label = text(`alert_${name}`);
  return row;
}
