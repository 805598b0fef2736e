// The trend of the last ten minutes: the swing with its 95 % interval as a band, the limits as lines, gaps where data are missing.

import {nowS} from "./link.js";
import {addShape} from "./svg.js";

const SPAN_S = 600;
const WIDTH = 460, HEIGHT = 104;

export class Trend {
  constructor(svg, labels) {
    this.svg = svg;
    this.labels = labels;
    this.points = [];
  }

  // Rows of the server: index, age in s, phi_max, low, high, sound.
  replace(rows) {
    this.points = [];
    this.add(rows);
  }

  add(rows) {
    const newest = this.points.at(-1)?.index ?? -1;
    for (const [index, ageS, phi, low, high, sound] of rows) {
      if (index > newest) this.points.push({index, atS: nowS() - ageS, phi, low, high, sound});
    }
    const oldest = nowS() - SPAN_S;
    this.points = this.points.filter((point) => point.atS >= oldest);
  }

  draw({warn_deg: warnDeg, trip_deg: tripDeg}) {
    const topDeg = Math.max(1.2 * tripDeg, ...this.points.map((point) => Math.min(point.high ?? point.phi ?? 0, 90)));
    const x = (atS) => (WIDTH * (1 - (nowS() - atS) / SPAN_S)).toFixed(1);
    const y = (deg) => (HEIGHT * (1 - Math.min(deg, topDeg) / topDeg)).toFixed(1);
    this.svg.replaceChildren();
    for (const minute of [2, 4, 6, 8]) this.path("grid", `M${(WIDTH * minute) / 10} 0V${HEIGHT}`);
    for (const run of splitRuns(this.points)) this.drawRun(run, x, y);
    this.path("limit warn", `M0 ${y(warnDeg)}H${WIDTH}`);
    this.path("limit trip", `M0 ${y(tripDeg)}H${WIDTH}`);
    this.label("warn", `warn ${warnDeg}°`, y(warnDeg));
    this.label("trip", `stop ${tripDeg}°`, y(tripDeg));
    this.svg.setAttribute("aria-label", `swing of the last ten minutes, ${this.points.length} values`);
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
  label(name, text, y) {
    let element = this.labels.querySelector(`.${name}`);
    if (!element) {
      element = document.createElement("span");
      element.className = name;
      this.labels.append(element);
    }
    element.textContent = text;
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
