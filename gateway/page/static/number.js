// Numbers as text. Limits are rounded outwards, so that a number is never more certain than it is.

export const NONE = "—";
const known = (value) => typeof value === "number" && Number.isFinite(value);

export const degrees = (value) => (known(value) ? `${value.toFixed(1)}°` : NONE);
export const upwards = (value) => (known(value) ? `${(Math.ceil(value * 10 - 1e-6) / 10).toFixed(1)}°` : NONE);
export const direction = (value) => (known(value) ? `${Math.round(value)}°` : NONE);
export const fixed = (value, digits, unit) => (known(value) ? `${value.toFixed(digits)} ${unit}` : NONE);
export const count = (value) => (known(value) ? String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f") : NONE);
export const isKnown = known;

export function ago(seconds) {
  if (!known(seconds)) return NONE;
  if (seconds < 2) return "now";
  if (seconds < 120) return `${Math.floor(seconds)} s ago`;
  if (seconds < 7200) return `${Math.floor(seconds / 60)} min ago`;
  return `${Math.floor(seconds / 3600)} h ago`;
}

// Use the farther end of the interval, so that the interval after "±" is never too narrow.
export function plusMinus(phi, interval) {
  if (!interval || !interval.every(known)) return "± not known";
  return `± ${upwards(Math.max(interval[1] - phi, phi - interval[0]))}`;
}
