// The alarm that the operator is told of.

const ALARMS = ["trip", "warn"];

// Return the first alarm of the highest level; null where none stands.
export function highest(alert) {
  const active = alert?.active ?? [];
  for (const level of ALARMS) {
    const found = active.find((one) => one.level === level);
    if (found) return found;
  }
  return null;
}

// Return the other alarms of the level of one whose reading is not below their limit.
export const besides = (alert, alarm) =>
  (alert?.active ?? []).filter((one) => one.level === alarm.level && one.rule !== alarm.rule && !(one.estimate_deg < one.limit_deg));

// Return the lean that the page shows, in degrees: that of a lean alarm while one stands; null where it is not known.
export const shownLean = ({alert, motion, swing}) =>
  (alert?.active ?? []).find((one) => one.rule === "lean")?.estimate_deg ?? motion?.lean_deg ?? swing?.lean_deg ?? null;
