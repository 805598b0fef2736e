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
