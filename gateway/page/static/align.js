// The screen for whoever turns the housing's two screws: which one, which way, how far. The server judges; this only shows it.

import {setText} from "./facts.js";
import {isKnown, NONE} from "./number.js";

const NS = "http://www.w3.org/2000/svg";
const MIDDLE = {pitch: -64, roll: 64};
const NO_ADVICE = {state: "not_still", screw: null, direction: null, turns: 0, text: "no advice: no readings come"};
const WORDS = {not_still: "WAIT", too_noisy: "WAIT", turn: "TURN", aligned: "ALIGNED"};

export class AlignScreen {
  constructor(section) {
    this.section = section;
    this.drawn = "";
  }

  show(view, wanted, gone) {
    this.section.hidden = !wanted;
    if (!wanted) return;
    const advice = gone || !view ? NO_ADVICE : view.advice;
    const word = document.getElementById("align-word");
    word.dataset.state = this.section.dataset.state = advice.state;
    setText("align-word", advice.state === "turn" ? `${advice.screw} ${advice.direction}`.toUpperCase() : WORDS[advice.state]);
    setText("align-turns", advice.state === "turn" ? turns(advice.turns) : "");
    setText("align-pitch", angle(gone ? null : view?.pitch_deg));
    setText("align-roll", angle(gone ? null : view?.roll_deg));
    setText("align-text", advice.state === "turn" ? "then let it hang still; if the angle grows, turn the other way" : advice.text);
    const u = view?.u_calibration_deg;
    setText("align-known", isKnown(u) ? `the calibration knows the vertical to ±${(2 * u).toFixed(2)}° (95 %)` : "");
    this.picture(advice);
  }

  // Drawn anew only where it changes.
  picture({state, screw, direction}) {
    const drawn = `${state} ${screw} ${direction}`;
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const svg = document.getElementById("screws");
    svg.replaceChildren();
    for (const name of ["pitch", "roll"]) drawScrew(svg, name, name === screw ? direction : null, state === "aligned");
    svg.setAttribute("aria-label", screw ? `turn the ${screw} screw ${direction}` : state);
  }
}

const angle = (value) => (isKnown(value) ? `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(2)}°` : NONE);

function turns(count) {
  return count < 0.095 ? `${Math.max(1, Math.round(360 * count))}° of a turn` : `${count.toFixed(count < 1 ? 2 : 1)} turn${count === 1 ? "" : "s"}`;
}

function shape(parent, name, attributes, text) {
  const element = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
}

// Right-handed threads, seen on the head: in is clockwise.
function drawScrew(svg, name, direction, done) {
  const x = MIDDLE[name];
  const css = direction ? "screw wanted" : done ? "screw done" : "screw";
  shape(svg, "circle", {class: css, cx: x, cy: 0, r: 30});
  shape(svg, "path", {class: "slot", d: `M${x - 18} 0H${x + 18}M${x} -18V18`});
  shape(svg, "text", {class: "screw-name", x, y: 78}, name);
  if (!direction) return;
  const way = direction === "in" ? 1 : -1; // the arc leads over the top, to the right where it is screwed in
  shape(svg, "path", {class: "screw-arrow", d: `M${x - way * 40} 23A46 46 0 1 ${way === 1 ? 1 : 0} ${x + way * 43} 16`});
  shape(svg, "path", {class: "screw-arrow", d: `M${x + way * 60} 2L${x + way * 42} 19L${x + way * 31} -3`});
}
