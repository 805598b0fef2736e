// Local times with the name of the zone.

const NS_PER_MS = 1e6;

// Return the local time of day of a time in ns since 1970.
export const timeOfDay = (time_ns) => new Date(time_ns / NS_PER_MS).toTimeString().slice(0, 8);

// Return the local time of day with its zone, such as "14:03:12 CET".
export function timeWithZone(time_ns) {
  const date = new Date(time_ns / NS_PER_MS);
  const zone = new Intl.DateTimeFormat(undefined, {timeZoneName: "short"}).formatToParts(date).find((part) => part.type === "timeZoneName");
  return `${timeOfDay(time_ns)} ${zone?.value ?? ""}`.trim();
}
