// The gauge: the angle that decides as a bar with its 95 % interval, the present angle, and the limits.

import {degrees, isKnown, limitText} from "./number.js";
import {text} from "./texts.js";

const BEYOND_LIMIT = 1.3; // scale of the gauge, in units of the limit
const EDGE = 0.98; // a marker beyond the scale stands at its end

export class Gauge {
  constructor(element) {
    this.element = element;
    const part = (selector) => element.querySelector(selector);
    this.parts = {fill: part(".fill"), band: part(".band"), now: part(".now"), warn: part(".warn"), trip: part(".trip")};
  }

  // `value` has the angle and half its interval, null where none is stated; a limit is null where there is none.
  draw(limits, value, presentDeg) {
    const scaleDeg = BEYOND_LIMIT * limits.trip_deg;
    const share = (deg, most = 1) => `${(100 * Math.min(Math.max(deg, 0) / scaleDeg, most)).toFixed(2)}cqw`;
    for (const [name, key] of [["warn", "warn_at"], ["trip", "limit_at"]]) {
      const limitDeg = limits[`${name}_deg`];
      place(this.parts[name], isKnown(limitDeg) ? share(limitDeg) : null);
      this.parts[name].firstElementChild.textContent = text(key, {angle: limitText(limitDeg)});
    }
    this.parts.fill.style.width = value === null ? "0" : share(value.angleDeg);
    this.parts.band.style.width = value === null ? "0" : share(value.angleDeg + (value.halfDeg ?? 0));
    place(this.parts.now, isKnown(presentDeg) ? share(presentDeg, EDGE) : null);
    const angle = value === null ? text("never") : degrees(value.angleDeg);
    const marks = Object.values(this.parts).filter((part) => part.matches(".mark") && !part.hidden);
    this.element.setAttribute("aria-label", [angle, ...marks.map((mark) => mark.textContent)].join(", "));
  }
}

function place(element, at) {
  element.hidden = at === null;
  if (at !== null) element.style.setProperty("--at", at);
}
