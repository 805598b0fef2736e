// A box with named axes, drawn with one of its directions upwards: the requested attitude of the sensor.

import {addShape} from "./svg.js";

const SIZE = [54, 40, 30]; // half edges along x, y, z; all three kinds of face differ
const LOOK = {azimuth: -0.6, elevation: 0.42};
const AXES = [
  ["+x", [1, 0, 0]], ["-x", [-1, 0, 0]], ["+y", [0, 1, 0]], ["-y", [0, -1, 0]], ["+z", [0, 0, 1]], ["-z", [0, 0, -1]],
];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((value) => value / Math.hypot(...a));

// Return the rows of the rotation that turns `up`, a direction in the box's axes, to the vertical.
export function rotationToVertical(up) {
  const vertical = unit(up);
  const axis = [0, 1, 2].reduce((least, k) => (Math.abs(vertical[k]) < Math.abs(vertical[least]) ? k : least), 0);
  const helper = [0, 1, 2].map((k) => (k === axis ? 1 : 0));
  const across = unit(cross(helper, vertical));
  return [cross(across, vertical), across, vertical];
}

// Project world coordinates (z up) onto the picture (right, down); `away` is the distance from the viewer.
export function project([x, y, z]) {
  const {azimuth, elevation} = LOOK;
  const right = x * Math.cos(azimuth) - y * Math.sin(azimuth);
  const away = x * Math.sin(azimuth) + y * Math.cos(azimuth);
  const upward = z * Math.cos(elevation) + away * Math.sin(elevation);
  return {right, down: -upward, away: away * Math.cos(elevation) - z * Math.sin(elevation)};
}

export function drawBox(svg, up) {
  svg.replaceChildren();
  addShape(svg, "path", {class: "box-ground", d: "M-100 84H100"});
  const rows = rotationToVertical(up);
  const place = (own) => project(rows.map((row) => dot(row, own)));
  const faces = AXES.map(([name, normal]) => face(name, normal, place)).filter(({away}) => away < 0);
  faces.sort((a, b) => b.away - a.away);
  for (const one of faces) {
    addShape(svg, "polygon", {class: `box-face shade-${one.shade}`, points: one.corners});
    addShape(svg, "text", {class: "box-name", x: one.middle.right, y: one.middle.down}, one.name);
  }
  addShape(svg, "path", {class: "box-up", d: "M86 20V-70M64 -46L86 -72L108 -46"});
}

function face(name, normal, place) {
  const k = normal.findIndex((value) => value !== 0);
  const [i, j] = [(k + 1) % 3, (k + 2) % 3];
  const middle = normal.map((value, axis) => value * SIZE[axis]);
  const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([a, b]) => {
    const corner = [...middle];
    corner[i] += a * SIZE[i];
    corner[j] += b * SIZE[j];
    const {right, down} = place(corner);
    return `${right.toFixed(1)},${down.toFixed(1)}`;
  });
  return {name, away: place(normal).away, middle: place(middle), corners: corners.join(" "), shade: k};
}

export function drawDone(svg) {
  svg.replaceChildren();
  addShape(svg, "path", {class: "box-done", d: "M-60 6L-18 52L66 -50"});
}
