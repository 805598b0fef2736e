// The view from above: the angle that decides as an ellipse about the lean, in the direction of the last swing, and the limits as
// circles. The outer circle is the limit at any time; what lies beyond ends at it, in its colour. The farthest point of the
// ellipse is at the deciding angle from the vertical. A dot shows where the load is now. The crane's own words stand at the ends of the
// axes.

import {shownLean} from "./alarm.js";
import {degrees, directionWords, isKnown, limitText} from "./number.js";
import {addShape} from "./svg.js";
import {text} from "./texts.js";

const RADIUS = 98;
const NAME_RADIUS = 114;
const STEP_RAD = Math.PI / 60;

const at = (deg, azimuthDeg) => {
  const a = (azimuthDeg * Math.PI) / 180;
  return {x: deg * Math.cos(a), y: -deg * Math.sin(a)};
};

export class Bullseye {
  constructor(svg) {
    this.svg = svg;
    addShape(addShape(svg, "clipPath", {id: "rim"}), "circle", {r: RADIUS + 5});
    this.ground = addShape(svg, "g", {});
    this.moving = addShape(svg, "g", {});
  }

  clear() {
    this.moving.replaceChildren();
    addShape(this.moving, "text", {class: "none", x: 0, y: -8}, text("no_reading"));
    this.svg.setAttribute("aria-label", text("no_reading"));
  }

  // `value` is the big number (peak.js); null: it is not known. A lean that decides is a cross alone, as every lean.
  draw(state, value) {
    const {motion} = state.topics, swing = {...state.topics.swing, lean_deg: shownLean(state.topics)};
    this.drawLimits(state.page);
    this.moving.replaceChildren();
    if (value !== null && !isLean(value)) this.drawAngle(value, swing);
    this.drawLean(swing);
    if (state.verdict.sound) this.drawLoad(motion);
    if (this.moving.childElementCount === 0) addShape(this.moving, "text", {class: "none", x: 0, y: -8}, text("never"));
    this.svg.classList.toggle("doubtful", !state.verdict.sound);
    this.svg.setAttribute("aria-label", describe(value, swing, state.page.directions));
  }

  drawLimits(page) {
    const drawn = JSON.stringify([page.warn_deg, page.trip_deg, page.directions]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.limitDeg = page.trip_deg;
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
      const r = this.radius(page[`${name}_deg`]);
      addShape(this.ground, "circle", {class: `limit ${name}`, r});
      const label = at(r, azimuthDeg);
      addShape(this.ground, "text", {class: "limit-name", x: label.x, y: label.y + 4}, limitText(page[`${name}_deg`]));
    }
  }

  // Return the distance from the centre of an angle, at most that of the limit.
  radius(deg) {
    return (RADIUS * Math.min(deg, this.limitDeg)) / this.limitDeg;
  }

  drawAngle({angleDeg, halfDeg, isBound}, swing) {
    const css = angleDeg >= this.limitDeg ? "swing beyond" : "swing";
    if (angleDeg <= halfDeg || !isKnown(swing?.azimuth_deg)) { // without a known direction all are possible
      addShape(this.moving, "circle", {class: css, r: this.radius(isBound ? angleDeg + halfDeg : angleDeg)});
      return;
    }
    const middle = at(this.radius(swing.lean_deg ?? 0), swing.lean_azimuth_deg ?? 0);
    const majorDeg = semiMajorDeg({...swing, phi_max_deg: angleDeg});
    const rx = Math.min((RADIUS * majorDeg) / this.limitDeg, RADIUS + Math.hypot(middle.x, middle.y));
    const ry = Math.min(Math.max(this.radius(swing.minor_phi_max_deg ?? 0), 0.5), rx);
    const turn = `translate(${middle.x} ${middle.y}) rotate(${-swing.azimuth_deg})`;
    const inside = addShape(this.moving, "g", {"clip-path": "url(#rim)"});
    const group = addShape(inside, "g", {class: css, transform: turn});
    addShape(group, "ellipse", {rx, ry});
    for (const side of [-1, 1]) {
      addShape(group, "line", {x1: side * rx, y1: -6, x2: side * rx, y2: 6});
    }
  }

  drawLean(swing) {
    if (!isKnown(swing?.lean_deg) || !isKnown(swing?.lean_azimuth_deg)) return;
    const {x, y} = at(this.radius(swing.lean_deg), swing.lean_azimuth_deg);
    addShape(this.moving, "path", {class: "lean", d: `M${x - 7} ${y}h14M${x} ${y - 7}v14`});
  }

  drawLoad(motion) {
    if (!isKnown(motion?.angle_deg) || !isKnown(motion?.azimuth_deg)) return;
    const {x, y} = at(this.radius(motion.angle_deg), motion.azimuth_deg);
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

const isLean = (value) => value.title === "leaning_angle";

function describe(value, swing, directions) {
  if (value === null) return text("never");
  if (isLean(value)) return `${text(value.title)} ${degrees(value.angleDeg)}`;
  const way = isKnown(swing?.azimuth_deg) ? text("along", {direction: directionWords(swing.azimuth_deg, directions)}) : "";
  const lean = isKnown(swing?.lean_deg) ? text("lean_words", {angle: degrees(swing.lean_deg)}) : "";
  return text("swing_words", {angle: degrees(value.angleDeg)}) + way + lean;
}
