// The view from above: the swing as an ellipse about the lean, and the limits as circles. The farthest point of the ellipse is
// at phi_max, the angle from the vertical; a thin line shows the upper end of its interval, which the alerts use. A dot shows where the
// load is now. The crane's own words stand at the ends of the axes.

import {degrees, directionWords, isKnown} from "./number.js";
import {addShape} from "./svg.js";
import {text} from "./texts.js";

const RADIUS = 98;
const NAME_RADIUS = 114;
const TRAIL_SWINGS = 6;
const STEP_RAD = Math.PI / 60;

const at = (deg, azimuthDeg) => {
  const a = (azimuthDeg * Math.PI) / 180;
  return {x: deg * Math.cos(a), y: -deg * Math.sin(a)};
};

export class Bullseye {
  constructor(svg) {
    this.svg = svg;
    this.swings = [];
    this.scaleDeg = null;
    this.ground = addShape(svg, "g", {});
    this.moving = addShape(svg, "g", {});
  }

  clear() {
    this.swings = [];
    this.moving.replaceChildren();
    addShape(this.moving, "text", {class: "none", x: 0, y: -8}, text("no_reading"));
    this.svg.setAttribute("aria-label", text("no_reading"));
  }

  draw(state) {
    const {swing, motion} = state.topics;
    this.setScale(state.page, swing);
    this.remember(swing);
    this.moving.replaceChildren();
    this.swings.forEach((past, i) => {
      const newest = i === this.swings.length - 1;
      this.drawSwing(past, newest ? "swing" : "swing past", newest ? 1 : 0.12 + (0.3 * i) / TRAIL_SWINGS);
    });
    this.drawUpperEnd(swing);
    this.drawLean(swing);
    this.drawLoad(motion);
    if (this.moving.childElementCount === 0) addShape(this.moving, "text", {class: "none", x: 0, y: -8}, text("never"));
    this.svg.classList.toggle("doubtful", !state.verdict.sound);
    this.svg.setAttribute("aria-label", describe(swing, state.page.directions));
  }

  // The limits set the scale, so that the picture keeps its meaning; a larger swing enlarges it.
  setScale(page, swing) {
    const reach = Math.max(swing?.phi_max_deg ?? 0, swing?.lean_deg ?? 0, Math.min(swing?.coverage95_deg?.[1] ?? 0, 45));
    const scaleDeg = Math.max(1.25 * page.trip_deg, Math.ceil((1.05 * reach) / 5) * 5 * (reach > 1.2 * page.trip_deg));
    const drawn = JSON.stringify([scaleDeg, page.directions]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.scaleDeg = scaleDeg;
    this.ground.replaceChildren();
    addShape(this.ground, "circle", {class: "field", r: RADIUS + 5});
    for (const [a, b] of [[-RADIUS, 0], [0, -RADIUS]]) {
      addShape(this.ground, "line", {class: "axis", x1: a, y1: b, x2: -a, y2: -b});
    }
    const {plus_x, minus_x, plus_y, minus_y} = page.directions;
    for (const [name, x, y, turn] of [[plus_x, 1, 0, 90], [minus_x, -1, 0, -90], [plus_y, 0, -1, 0], [minus_y, 0, 1, 0]]) {
      const [nameX, nameY] = [x * NAME_RADIUS, y * (NAME_RADIUS - 4)];
      addShape(this.ground, "text", {class: "axis-name", x: nameX, y: nameY, transform: `rotate(${turn} ${nameX} ${nameY})`}, name);
    }
    for (const [name, azimuthDeg] of [["warn", 225], ["trip", 315]]) {
      const r = page[`${name}_deg`] * this.perDeg();
      addShape(this.ground, "circle", {class: `limit ${name}`, r});
      const label = at(r, azimuthDeg);
      addShape(this.ground, "text", {class: "limit-name", x: label.x, y: label.y + 4}, `${page[`${name}_deg`]}°`);
    }
  }

  perDeg() {
    return RADIUS / this.scaleDeg;
  }

  remember(swing) {
    if (!swing || !isKnown(swing.phi_max_deg) || !swing.swinging) this.swings = [];
    else if (this.swings.at(-1)?.time_ns !== swing.time_ns) this.swings = [...this.swings, swing].slice(-TRAIL_SWINGS);
  }

  drawSwing(swing, css, opacity) {
    const middle = at((swing.lean_deg ?? 0) * this.perDeg(), swing.lean_azimuth_deg ?? 0);
    if (!isKnown(swing.azimuth_deg)) { // without a known direction all are possible
      addShape(this.moving, "circle", {class: css, r: swing.phi_max_deg * this.perDeg(), opacity});
      return;
    }
    const rx = semiMajorDeg(swing) * this.perDeg();
    const ry = Math.max((swing.minor_phi_max_deg ?? 0) * this.perDeg(), 0.5);
    const turn = `translate(${middle.x} ${middle.y}) rotate(${-swing.azimuth_deg})`;
    const group = addShape(this.moving, "g", {class: css, transform: turn, opacity});
    addShape(group, "ellipse", {rx, ry});
    for (const side of [-1, 1]) {
      addShape(group, "line", {x1: side * rx, y1: -6, x2: side * rx, y2: 6});
    }
  }

  drawUpperEnd(swing) {
    const highDeg = swing?.coverage95_deg?.[1];
    if (!isKnown(highDeg)) return;
    const azimuth_deg = swing.swinging ? swing.azimuth_deg : null;
    this.drawSwing({...swing, azimuth_deg, phi_max_deg: Math.min(highDeg, this.scaleDeg)}, "swing upper", 1);
  }

  drawLean(swing) {
    if (!isKnown(swing?.lean_deg) || !isKnown(swing?.lean_azimuth_deg)) return;
    const {x, y} = at(swing.lean_deg * this.perDeg(), swing.lean_azimuth_deg);
    addShape(this.moving, "path", {class: "lean", d: `M${x - 7} ${y}h14M${x} ${y - 7}v14`});
  }

  drawLoad(motion) {
    if (!isKnown(motion?.angle_deg) || !isKnown(motion?.azimuth_deg)) return;
    const {x, y} = at(Math.min(motion.angle_deg, this.scaleDeg) * this.perDeg(), motion.azimuth_deg);
    addShape(this.moving, "circle", {class: "load", cx: x, cy: y, r: 7});
  }
}

// Return the semi-major axis of the ellipse about the lean whose farthest point from the vertical is at phi_max.
export function semiMajorDeg(swing) {
  const leanDeg = swing.lean_deg ?? 0;
  const between = (((swing.lean_azimuth_deg ?? 0) - swing.azimuth_deg) * Math.PI) / 180;
  const minorDeg = swing.minor_phi_max_deg ?? 0;
  const farthest = (majorDeg) => {
    let most = 0;
    for (let t = 0; t < 2 * Math.PI; t += STEP_RAD) {
      const along = majorDeg * Math.cos(t) + leanDeg * Math.cos(between);
      const across = minorDeg * Math.sin(t) + leanDeg * Math.sin(between);
      most = Math.max(most, Math.hypot(along, across));
    }
    return most;
  };
  let [low, high] = [0, swing.phi_max_deg + leanDeg];
  for (let halving = 0; halving < 12; halving += 1) {
    const middle = (low + high) / 2;
    if (farthest(middle) < swing.phi_max_deg) low = middle;
    else high = middle;
  }
  return (low + high) / 2;
}

function describe(swing, directions) {
  if (!swing || !isKnown(swing.phi_max_deg)) return text("never");
  const way = isKnown(swing.azimuth_deg) ? text("along", {direction: directionWords(swing.azimuth_deg, directions)}) : "";
  const lean = isKnown(swing.lean_deg) ? text("lean_words", {angle: degrees(swing.lean_deg)}) : "";
  return text("swing_words", {angle: degrees(swing.phi_max_deg)}) + way + lean;
}
