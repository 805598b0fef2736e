// A sketch of how the housing hangs on the rope, with its axes and the directions of the crane that they point to.

import {addShape} from "./svg.js";
import {text} from "./texts.js";

export class Mounting {
  constructor(svg) {
    this.svg = svg;
    this.drawn = "";
  }

  draw(directions) {
    const drawn = JSON.stringify([directions, document.documentElement.lang]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const svg = this.svg;
    svg.replaceChildren();
    addShape(svg, "path", {class: "rope", d: "M110 0V70M110 130V205"});
    addShape(svg, "rect", {class: "housing", x: 85, y: 70, width: 50, height: 60, rx: 5});
    addShape(svg, "path", {class: "housing", d: "M80 205h60l12 45H68z"});
    addShape(svg, "text", {class: "caption", x: 92, y: 234}, text("load"));
    this.arrow("M125 62V18", "M117 28l8 -11l8 11");
    this.arrow("M140 100h52", "M182 92l11 8l-11 8");
    this.arrow("M84 112l-38 26", "M60 135l-15 4l5 -15");
    addShape(svg, "text", {class: "caption", x: 140, y: 24}, text("up_rope"));
    addShape(svg, "text", {class: "caption", x: 146, y: 88}, `x: ${directions.plus_x}`);
    addShape(svg, "text", {class: "caption", x: 4, y: 162}, `y: ${directions.plus_y}`);
    svg.setAttribute("aria-label", text("mounting_words", {x: directions.plus_x, y: directions.plus_y}));
  }

  arrow(line, head) {
    addShape(this.svg, "path", {class: "arrow", d: line});
    addShape(this.svg, "path", {class: "arrow", d: head});
  }
}
