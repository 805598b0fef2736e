// The list of alerts, newest first: from when to when, what, the largest value, the limit.

import {degrees, isKnown, upwards} from "./number.js";
import {setText} from "./facts.js";
import {hasText, text} from "./texts.js";
import {timeOfDay} from "./time.js";

export class AlertList {
  constructor(body) {
    this.body = body;
    this.shown = "";
  }

  show({since_ns: sinceNs, alerts}) {
    const time = timeOfDay(sinceNs);
    setText("alerts-title", text("alerts_of", {time}));
    setText("alerts-none", alerts.length === 0 ? text("no_alerts", {time}) : "");
    const shown = JSON.stringify([alerts, document.documentElement.lang]);
    if (shown === this.shown) return;
    this.shown = shown;
    this.body.replaceChildren(...[...alerts].reverse().map(row));
  }
}

function row(alert) {
  const line = document.createElement("tr");
  line.dataset.level = alert.level;
  line.classList.toggle("standing", alert.until_ns === null);
  const rule = hasText(`rule_${alert.rule}`) ? text(`rule_${alert.rule}`) : alert.rule;
  const cells = [
    timeOfDay(alert.since_ns),
    alert.until_ns === null ? text("alert_standing") : timeOfDay(alert.until_ns),
    `${rule}: ${text(`level_${alert.level}`)}`,
    upwards(alert.largest_deg),
    isKnown(alert.limit_deg) ? degrees(alert.limit_deg) : "",
  ];
  line.append(...cells.map((content, i) => Object.assign(document.createElement("td"), {textContent: content, className: i === 2 ? "what" : ""})));
  return line;
}
