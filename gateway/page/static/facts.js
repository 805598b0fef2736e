// The state of the measurement for the service engineer, as texts, each marked when it is bad. All texts are set as text, never as markup.

import {ago, count, decimal, fixed, isKnown, NONE} from "./number.js";
import {partName, text} from "./texts.js";
import {timeWithZone} from "./time.js";

export function setText(id, content) {
  const element = document.getElementById(id);
  if (element.textContent !== content) element.textContent = content;
}

function setFact(name, content, bad = false) {
  const row = document.getElementById(`fact-${name}`);
  const value = row.querySelector("dd");
  if (value.textContent !== content) value.textContent = content;
  row.classList.toggle("bad", bad);
}

export function showFacts(state, waitedS) {
  const {tilt, motion, swing, health, calibration, condition} = state.topics;
  const good = state.last_good;
  const goodAgeS = good ? good.age_s + waitedS : null;
  setFact("good", good ? ago(goodAgeS) : text("none_yet"), !good || goodAgeS > 5);
  const trust = condition?.trusted ? text("trusted") : text("not_trusted");
  setFact("condition", condition ? `${text(`verdict_${condition.verdict}`)}, ${trust}` : NONE, Boolean(condition) && !condition.trusted);
  setFact("period", `${fixed(swing?.period_s, 2, "s")}, ${fixed(motion?.length_m, 2, "m")}`);
  const pivot = motion?.pivot_accel_m_s2;
  setFact("pivot", `${fixed(pivot && Math.hypot(...pivot), 2, "m/s²")}, ${fixed(motion?.hoist_m_s, 2, "m/s")}`);
  const status = calibration?.status ?? condition?.calibration;
  const calibrated = status === "calibrated" || status === "factory";
  const offered = health?.offer ? text("calibration_offered", {record: health.offer.record}) : "";
  setFact("calibration", status ? `${text(`calibration_${status}`)}${offered}` : NONE, Boolean(status) && !calibrated);
  const newest = tilt ?? swing;
  setText("clock-quality", newest ? text(`clock_${newest.clock}`) : text("fact_clock"));
  setFact("clock", newest ? timeWithZone(newest.time_ns) : NONE, newest?.clock === "free_running" && health?.device_kind !== "simulated");
  if (health) showHealth(health);
}

// Without readings at rest the drift is not known; it is never shown as good.
function driftText(drift) {
  if (!drift || !isKnown(drift.norm_error_mg)) return text("never");
  const error = `${drift.norm_error_mg < 0 ? "−" : "+"}${decimal(Math.abs(drift.norm_error_mg), 1)}`;
  return drift.state === "alarm" ? `ALARM ${error} mg` : `${error} / ±${decimal(drift.limit_mg, 1)} mg`;
}

function showHealth(health) {
  setFact("drift", driftText(health.drift), health.drift?.state === "alarm");
  const lostShare = health.samples > 0 ? (100 * health.lost) / (health.samples + health.lost) : 0;
  const state = health.state === "running" ? "" : `, ${text(`state_${health.state}`)}`;
  setFact("device", `${health.device_id ?? health.device_kind}${state}`, health.state !== "running");
  setFact("rate", isKnown(health.measured_rate_hz) ? fixed(health.measured_rate_hz, 1, "Hz") : NONE);
  setFact("lost", `${count(health.lost)} (${decimal(lostShare, lostShare < 10 ? 2 : 0)} %)`, lostShare > 1);
  setFact("recording", recordingText(health), Boolean(health.recording_error) || !health.recording);
  setFact("faults", Object.entries(health.faults).map(faultText).join(", ") || text("none"));
}

// Return the name of a part that failed, or a device's own word for what went wrong, and how often.
function faultText([name, n]) {
  const part = /^(.*)_(?:failures|defects)$/.exec(name)?.[1];
  return `${part ? partName(part) : name.replaceAll("_", " ")} ${count(n)}×`;
}

function recordingText(health) {
  if (health.recording_error) return text("recording_error", {reason: health.recording_error});
  const size = isKnown(health.disk_free_mb) ? text("free_space", {size: fixed(health.disk_free_mb / 1000, 1, "GB")}) : "";
  return `${text(health.recording ? "recording_on" : "recording_off")}${size}`;
}
