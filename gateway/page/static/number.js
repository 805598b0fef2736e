// Numbers as text. Limits are rounded outwards, so that a number is never more certain than it is.

import {text} from "./texts.js";

export const NONE = "—";
const known = (value) => typeof value === "number" && Number.isFinite(value);

// A value that rounds to zero has no sign.
export const decimal = (value, digits) => value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace(".", text("decimal_mark"));
export const degrees = (value) => (known(value) ? `${decimal(value, 1)}°` : NONE);
export const limitText = (value) => `${String(value).replace(".", text("decimal_mark"))}°`; // as it was configured
export const upwards = (value) => degrees(known(value) ? Math.ceil(value * 10 - 1e-6) / 10 : value);
export const fixed = (value, digits, unit) => (known(value) ? `${decimal(value, digits)} ${unit}` : NONE);
export const count = (value) => (known(value) ? String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f") : NONE);
export const isKnown = known;

export function ago(seconds) {
  if (!known(seconds)) return NONE;
  if (seconds < 2) return text("now_ago");
  if (seconds < 120) return text("seconds_ago", {count: Math.floor(seconds)});
  if (seconds < 7200) return text("minutes_ago", {count: Math.floor(seconds / 60)});
  return text("hours_ago", {count: Math.floor(seconds / 3600)});
}

// Return the crane's word for an azimuth: one direction, or the two that it lies between.
export function directionWords(azimuthDeg, {plus_x, plus_y, minus_x, minus_y}) {
  if (!known(azimuthDeg)) return "";
  const names = [plus_x, plus_y, minus_x, minus_y];
  const quarter = (((azimuthDeg % 360) + 360) % 360) / 90;
  const [from, beyond] = [Math.floor(quarter), quarter % 1];
  if (beyond < 0.25) return names[from % 4];
  if (beyond > 0.75) return names[(from + 1) % 4];
  return `${names[from % 4]} / ${names[(from + 1) % 4]}`;
}

// Return the crane's word that is nearest to an azimuth.
export function nearestDirection(azimuthDeg, {plus_x, plus_y, minus_x, minus_y}) {
  if (!known(azimuthDeg)) return "";
  return [plus_x, plus_y, minus_x, minus_y][Math.round((((azimuthDeg % 360) + 360) % 360) / 90) % 4];
}
