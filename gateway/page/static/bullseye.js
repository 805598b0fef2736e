// The view from above: the swing as an ellipse about the lean, and the limits as circles. The farthest point of the ellipse is
// at phi_max, the angle from the vertical; a thin line shows the upper end of its interval, which the alerts use.
// The static tilt is drawn only while it is valid; during a swing an accelerometer shows only a part of the angle.

import {isKnown} from "./number.js";
import {addShape} from "./svg.js";

const RADIUS = 98;
const TRAIL_SWINGS = 6;
const TRAIL_TILTS = 40;
const STEP_RAD = Math.PI / 60;

const at = (deg, azimuthDeg) => {
  const a = (azimuthDeg * Math.PI) / 180;
  return {x: deg * Math.cos(a), y: -deg * Math.sin(a)};
};

export class Bullseye {
  constructor(svg) {
    this.svg = svg;
    this.swings = [];
    this.tilts = [];
    this.scaleDeg = null;
    this.ground = addShape(svg, "g", {});
    this.moving = addShape(svg, "g", {});
  }

  clear() {
    this.swings = [];
    this.tilts = [];
    this.moving.replaceChildren();
    addShape(this.moving, "text", {class: "none", x: 0, y: -8}, "no reading");
    this.svg.setAttribute("aria-label", "no reading");
  }

  draw(state) {
    const {swing, tilt} = state.topics;
    this.setScale(state.page, swing);
    this.remember(swing, tilt);
    this.moving.replaceChildren();
    this.drawTilts(tilt);
    this.swings.forEach((past, i) => {
      const newest = i === this.swings.length - 1;
      this.drawSwing(past, newest ? "swing" : "swing past", newest ? 1 : 0.12 + (0.3 * i) / TRAIL_SWINGS);
    });
    this.drawUpperEnd(swing);
    this.drawLean(swing);
    if (this.moving.childElementCount === 0) addShape(this.moving, "text", {class: "none", x: 0, y: -8}, "not known");
    this.svg.classList.toggle("doubtful", !state.verdict.sound);
    this.svg.setAttribute("aria-label", describe(swing));
  }

  // The limits set the scale, so that the picture keeps its meaning; a larger swing enlarges it.
  setScale(page, swing) {
    const reach = Math.max(swing?.phi_max_deg ?? 0, swing?.lean_deg ?? 0, Math.min(swing?.coverage95_deg?.[1] ?? 0, 45));
    const scaleDeg = Math.max(1.25 * page.trip_deg, Math.ceil((1.05 * reach) / 5) * 5 * (reach > 1.2 * page.trip_deg));
    if (scaleDeg === this.scaleDeg) return;
    this.scaleDeg = scaleDeg;
    this.ground.replaceChildren();
    addShape(this.ground, "circle", {class: "field", r: RADIUS + 5});
    for (const [a, b] of [[-RADIUS, 0], [0, -RADIUS]]) {
      addShape(this.ground, "line", {class: "axis", x1: a, y1: b, x2: -a, y2: -b});
    }
    addShape(this.ground, "text", {class: "axis-name", x: RADIUS - 6, y: -5}, "x");
    addShape(this.ground, "text", {class: "axis-name", x: 9, y: -RADIUS + 10}, "y");
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

  remember(swing, tilt) {
    if (!swing || !isKnown(swing.phi_max_deg) || !swing.swinging) this.swings = [];
    else if (this.swings.at(-1)?.time_ns !== swing.time_ns) this.swings = [...this.swings, swing].slice(-TRAIL_SWINGS);
    if (!tilt?.trusted || !isKnown(tilt.axial_deg) || !isKnown(tilt.direction_deg)) this.tilts = [];
    else if (this.tilts.at(-1)?.time_ns !== tilt.time_ns) this.tilts = [...this.tilts, tilt].slice(-TRAIL_TILTS);
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

  drawTilts(tilt) {
    if (this.tilts.length === 0) return;
    const points = this.tilts.map((one) => at(Math.min(one.axial_deg, this.scaleDeg) * this.perDeg(), one.direction_deg));
    const path = points.map(({x, y}) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");
    addShape(this.moving, "polyline", {class: "tilt-trail", points: path});
    const {x, y} = points.at(-1);
    addShape(this.moving, "circle", {class: "tilt", cx: x, cy: y, r: 11});
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

function describe(swing) {
  if (!swing || !isKnown(swing.phi_max_deg)) return "swing not known";
  const way = isKnown(swing.azimuth_deg) ? ` along ${swing.azimuth_deg.toFixed(0)} degrees` : "";
  const lean = isKnown(swing.lean_deg) ? `, lean ${swing.lean_deg.toFixed(1)} degrees` : "";
  return `swing ${swing.phi_max_deg.toFixed(1)} degrees${way}${lean}`;
}
