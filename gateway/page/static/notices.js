// Faults of the gateway: one line on the operator's screen where the operator must act, everything on the service screen.

import {partName, text} from "./texts.js";

// Return the operator's line; empty where the operator need not act.
export function operatorNotice(health) {
  if (!health) return "";
  const faults = health.standing_faults ?? {};
  if (health.relay === "failed" || faults.relay) return text("note_relay");
  if (health.battery_low) return text("note_battery");
  if (health.recording_error || faults.recording) return text("note_recording");
  if (health.changed_limits?.length) return text("note_limits");
  return "";
}

// Return the lines for the service engineer; what fails is followed by the words of the log.
export function serviceNotices(health) {
  if (!health) return [];
  const state = health.state === "running" ? [] : [`${text("fact_device")}: ${text(`state_${health.state}`)}`];
  const recording = health.recording_error ? [`${text("not_recording")} ${health.recording_error}`] : [];
  const others = Object.entries(health.standing_faults ?? {}).filter(([part]) => part !== "recording")
    .map(([part, reason]) => `${text("fleet_fault", {parts: partName(part)})} ${reason}`);
  return [...state, ...recording, ...others, ...(health.changed_limits ?? []).map((change) => `${text("note_limits")} ${change}`)];
}
