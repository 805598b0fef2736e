// The gauge: the angle that decides as a bar with its 95 % interval, the present angle, and the limits.

import {degrees, isKnown, limitText} from "./number.js";
import {scaleShare} from "./scale.js";
import {text} from "./texts.js";

export class Gauge {
  constructor(element) {
    this.element = element;
    const part = (selector) => element.querySelector(selector);
    this.parts = {fill: part(".fill"), band: part(".band"), now: part(".now"), warn: part(".warn"), trip: part(".trip")};
  }

  // `value` has the angle and half its interval, null where none is stated; a limit is null where there is none.
  draw(limits, value, presentDeg) {
    const share = (deg) => `${(100 * scaleShare(deg, limits.trip_deg)).toFixed(2)}cqw`;
    for (const [name, key] of [["warn", "warn_at"], ["trip", "limit_at"]]) {
      const limitDeg = limits[`${name}_deg`];
      place(this.parts[name], isKnown(limitDeg) ? share(limitDeg) : null);
      this.parts[name].firstElementChild.textContent = text(key, {angle: limitText(limitDeg)});
    }
    this.parts.fill.style.width = value === null ? "0" : share(value.angleDeg);
    this.parts.band.style.width = value === null ? "0" : share(value.angleDeg + (value.halfDeg ?? 0));
    place(this.parts.now, isKnown(presentDeg) ? share(presentDeg) : null);
    const angle = value === null ? text("never") : degrees(value.angleDeg);
    const marks = Object.values(this.parts).filter((part) => part.matches(".mark") && !part.hidden);
    this.element.setAttribute("aria-label", [angle, ...marks.map((mark) => mark.textContent)].join(", "));
  }
}

function place(element, at) {
  element.hidden = at === null;
  if (at !== null) element.style.setProperty("--at", at);
}
