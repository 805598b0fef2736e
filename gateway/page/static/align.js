// The screen for the person who turns the two screws of the housing: which screw, in which direction, how far.

import {setText} from "./facts.js";
import {decimal, isKnown, NONE} from "./number.js";
import {reasonText} from "./sentence.js";
import {addShape} from "./svg.js";
import {text} from "./texts.js";

const MIDDLE = {pitch: -64, roll: 64};
const WORDS = {not_still: "align_wait", too_noisy: "align_wait", aligned: "align_aligned"};

export class AlignScreen {
  constructor(section) {
    this.section = section;
    this.drawn = "";
  }

  show(view, turn, wanted, gone) {
    this.section.hidden = !wanted;
    if (!wanted) return;
    const none = {state: "not_still", screw: null, direction: null, turns: 0, code: null};
    const advice = gone || !view ? none : view.advice;
    const word = document.getElementById("align-word");
    word.dataset.state = this.section.dataset.state = advice.state;
    setText("align-word", text(advice.state === "turn" ? `align_${advice.screw}_${advice.direction}` : WORDS[advice.state]));
    setText("align-turns", advice.state === "turn" ? turns(advice.turns) : "");
    setText("align-pitch", angle(gone ? null : view?.pitch_deg));
    setText("align-roll", angle(gone ? null : view?.roll_deg));
    setText("align-text", advice.state === "turn" ? text("align_then") : advice.code ? reasonText(advice.code) : text("align_no_readings"));
    const u = view?.u_calibration_deg;
    setText("align-known", isKnown(u) ? text("align_u", {angle: decimal(2 * u, 2)}) : "");
    setText("align-shaft", gone || !turn ? "" : shaftText(turn));
    this.picture(advice);
  }

  // Draw only when the picture changes.
  picture({state, screw, direction}) {
    const drawn = `${state} ${screw} ${direction} ${document.documentElement.lang}`;
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const svg = document.getElementById("screws");
    svg.replaceChildren();
    for (const name of ["pitch", "roll"]) drawScrew(svg, name, name === screw ? direction : null, state === "aligned");
    svg.setAttribute("aria-label", text(screw ? `align_${screw}_${direction}` : WORDS[state]));
  }
}

const angle = (value) => (isKnown(value) ? `${value < 0 ? "−" : "+"}${decimal(Math.abs(value), 2)}°` : NONE);

function turns(count) {
  if (count < 0.095) return text("turn_degrees", {count: Math.max(1, Math.round(360 * count))});
  return text(count === 1 ? "turns_one" : "turns_many", {count: decimal(count, count < 1 ? 2 : 1)});
}

// Return what to do after a turn on a shaft, with the errors of alignment (Łuczak et al. 2022, eq. 1 and 2).
function shaftText({turned_rad: turnedRad, n_turns: count, advice}) {
  const turning = text("shaft_turning", {turned: degreesOf(turnedRad, 0), number: count + 1});
  if (!advice) return turning;
  const {screw_axis: axis, direction, precision_error_rad: apeRad, total_error_rad: taeRad} = advice;
  const values = advice.state === "adjust" ? {axis, direction: text(`way_${direction}`), turns: turns(advice.turns)} : {};
  return `${text(`shaft_${advice.state}`, values)} ${text("shaft_errors", {ape: degreesOf(apeRad, 3), tae: degreesOf(taeRad, 3)})} ${turning}`;
}

const degreesOf = (angleRad, digits) => decimal((180 / Math.PI) * angleRad, digits);

// Right-handed threads, heads towards the viewer: in is clockwise.
function drawScrew(svg, name, direction, done) {
  const x = MIDDLE[name];
  const css = direction ? "screw wanted" : done ? "screw done" : "screw";
  addShape(svg, "circle", {class: css, cx: x, cy: 0, r: 30});
  addShape(svg, "path", {class: "slot", d: `M${x - 18} 0H${x + 18}M${x} -18V18`});
  addShape(svg, "text", {class: "screw-name", x, y: 78}, text(name));
  if (!direction) return;
  const way = direction === "in" ? 1 : -1; // the arc passes over the top, clockwise for in
  addShape(svg, "path", {class: "screw-arrow", d: `M${x - way * 40} 23A46 46 0 1 ${way === 1 ? 1 : 0} ${x + way * 43} 16`});
  addShape(svg, "path", {class: "screw-arrow", d: `M${x + way * 60} 2L${x + way * 42} 19L${x + way * 31} -3`});
}
