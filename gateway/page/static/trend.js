// The trend of the last ten minutes: the swing with its 95 % interval as a band, the limits as lines, the alarms as bars at the
// bottom, and gaps where data are missing. The limits alone set the scale (scale.js), so that the picture keeps its meaning.

import {nowS} from "./link.js";
import {limitText} from "./number.js";
import {scaleShare} from "./scale.js";
import {addShape} from "./svg.js";
import {text} from "./texts.js";
import {timeOfDay} from "./time.js";

const SPAN_S = 600;
const WIDTH = 1000, HEIGHT = 100;
const TICK_S = 120;

export class Trend {
  constructor(svg, labels, times) {
    this.svg = svg;
    this.labels = labels;
    this.times = times;
    this.points = [];
    this.history = null; // the server's name of it, another one after its restart
  }

  // Take the history of a server, or what was missing of it. Rows: index, age in s, phi_max, low, high, sound.
  take({id, points}) {
    if (id !== this.history) this.points = [];
    this.history = id;
    this.add(points);
  }

  // Return what is there of the history, for the server.
  known() {
    const newest = this.points.at(-1);
    return newest === undefined || this.history === null ? "" : `?history=${this.history}&after=${newest.index}`;
  }

  add(rows) {
    const newest = this.points.at(-1)?.index ?? -1;
    for (const [index, ageS, phi, low, high, sound] of rows) {
      if (index > newest) this.points.push({index, atS: nowS() - ageS, phi, low, high, sound});
    }
    const oldest = nowS() - SPAN_S;
    this.points = this.points.filter((point) => point.atS >= oldest);
  }

  // `timeNs` is the time of the newest data, `alerts` the list of alerts.
  draw({warn_deg: warnDeg, trip_deg: tripDeg}, timeNs, alerts) {
    const x = (ageS) => (WIDTH * (1 - ageS / SPAN_S)).toFixed(1);
    const y = (deg) => (HEIGHT * (1 - scaleShare(deg, tripDeg))).toFixed(1);
    this.svg.replaceChildren();
    this.drawTimes(timeNs, x);
    for (const run of splitRuns(this.points)) this.drawRun(run, (atS) => x(nowS() - atS), y);
    this.path("limit warn", `M0 ${y(warnDeg)}H${WIDTH}`);
    this.path("limit trip", `M0 ${y(tripDeg)}H${WIDTH}`);
    this.drawAlerts(alerts, timeNs, x);
    this.label("warn", limitText(warnDeg), y(warnDeg));
    this.label("trip", limitText(tripDeg), y(tripDeg));
    this.labelBegin(timeNs, x);
    this.svg.setAttribute("aria-label", text("trend_words", {count: this.points.length}));
  }

  // Say since when there is a curve, after a start: what was before is in the recording.
  labelBegin(timeNs, x) {
    const ageS = nowS() - (this.points[0]?.atS ?? nowS()), isShort = ageS < SPAN_S - TICK_S;
    this.label("begin", isShort ? text("trend_begins", {time: timeOfDay(timeNs - ageS * 1e9).slice(0, 5)}) : "", 0.8 * HEIGHT);
    if (isShort) this.path("absent", `M0 0H${x(ageS)}V${HEIGHT}H0Z`);
  }

  // A line and a local time every two minutes.
  drawTimes(timeNs, x) {
    const timeS = timeNs / 1e9;
    const labels = [];
    for (let tickS = Math.floor(timeS / TICK_S) * TICK_S; tickS > timeS - SPAN_S; tickS -= TICK_S) {
      const at = x(timeS - tickS);
      this.path("grid", `M${at} 0V${HEIGHT}`);
      const label = document.createElement("span");
      label.textContent = timeOfDay(tickS * 1e9).slice(0, 5);
      label.style.left = `clamp(2.2rem, ${(100 * at) / WIDTH}%, calc(100% - 2.2rem))`;
      labels.push(label);
    }
    this.times.replaceChildren(...labels);
  }

  drawAlerts(alerts, timeNs, x) {
    for (const {level, since_ns: sinceNs, until_ns: untilNs} of alerts) {
      const toS = (timeNs - (untilNs ?? timeNs)) / 1e9, fromS = (timeNs - sinceNs) / 1e9;
      if (toS < SPAN_S && level !== "unknown") this.path(`alarm ${level}`, `M${x(Math.min(fromS, SPAN_S))} ${HEIGHT - 1}H${x(toS)}`);
    }
  }

  drawRun(run, x, y) {
    const doubtful = run[0].sound ? "" : " doubtful";
    const band = run.filter((point) => point.high !== null);
    const upper = band.map((point) => `${x(point.atS)} ${y(point.high)}`);
    const lower = band.map((point) => `${x(point.atS)} ${y(point.low ?? 0)}`).reverse();
    if (band.length > 0) this.path(`band${doubtful}`, `M${upper.join("L")}L${lower.join("L")}Z`);
    const line = run.filter((point) => point.phi !== null).map((point) => `${x(point.atS)} ${y(point.phi)}`);
    if (line.length > 0) this.path(`line${doubtful}`, `M${line.join("L")}${line.length === 1 ? "h0" : ""}`); // a dot
  }

  path(css, d) {
    addShape(this.svg, "path", {class: css, d});
  }

  // Labels are HTML, because text in a stretched drawing would be stretched, too.
  label(name, content, y) {
    let element = this.labels.querySelector(`.${name}`);
    if (!element) {
      element = document.createElement("span");
      element.className = name;
      this.labels.append(element);
    }
    element.textContent = content;
    element.style.top = `${(100 * y) / HEIGHT}%`;
  }
}

// Split the points at gaps and at changes of `sound`.
function splitRuns(points) {
  const found = [];
  let run = [];
  for (const point of points) {
    const gap = point.phi === null && point.high === null;
    if (gap || (run.length > 0 && run[0].sound !== point.sound)) {
      found.push(run);
      run = [];
    }
    if (!gap) run.push(point);
  }
  found.push(run);
  return found.filter((one) => one.length > 0);
}
