// The state of the measurement as a list of texts, each marked when it is bad. All texts are set as text, never as markup.

import {ago, count, fixed, isKnown, NONE} from "./number.js";

export function setText(id, text) {
  const element = document.getElementById(id);
  if (element.textContent !== text) element.textContent = text;
}

function setFact(name, text, bad = false) {
  const row = document.getElementById(`fact-${name}`);
  const value = row.querySelector("dd");
  if (value.textContent !== text) value.textContent = text;
  row.classList.toggle("bad", bad);
}

const CLOCKS = {synchronised: "synchronised", free_running: "free running", replayed: "of the recording"};

export function showFacts(state, waitedS) {
  const {tilt, swing, health, calibration, condition} = state.topics;
  const good = state.last_good;
  const goodAgeS = good ? good.age_s + waitedS : null;
  setFact("good", good ? ago(goodAgeS) : "none yet", !good || goodAgeS > 5);
  const status = calibration?.status ?? condition?.calibration;
  const trusted = status === "calibrated" || status === "factory";
  setFact("calibration", status ? status.replace("_", " ") : NONE, Boolean(status) && !trusted);
  const clock = (tilt ?? swing)?.clock;
  setText("clock-quality", clock ? `clock, ${CLOCKS[clock] ?? clock}` : "clock");
  setFact("clock", clock ? timeOfDay(tilt ?? swing) : NONE, clock === "free_running");
  if (health) showHealth(health);
}

// Without readings at rest the drift is not known; it is never shown as good.
function driftText(drift) {
  if (!drift || !isKnown(drift.norm_error_mg)) return "not known yet";
  const error = `${drift.norm_error_mg < 0 ? "−" : "+"}${Math.abs(drift.norm_error_mg).toFixed(1)}`;
  return drift.state === "alarm" ? `ALARM ${error} mg` : `${error} of ±${drift.limit_mg.toFixed(1)} mg`;
}

function showHealth(health) {
  setFact("drift", driftText(health.drift), health.drift?.state === "alarm");
  const lostShare = health.samples > 0 ? (100 * health.lost) / (health.samples + health.lost) : 0;
  const faults = Object.values(health.faults).reduce((sum, n) => sum + n, 0);
  const state = health.state === "running" ? "" : ` ${health.state}`;
  setFact("device", `${health.device_id ?? health.device_kind}${state}`, health.state !== "running");
  setFact("rate", isKnown(health.measured_rate_hz) ? fixed(health.measured_rate_hz, 1, "Hz") : NONE);
  setFact("lost", `${count(health.lost)} (${lostShare.toFixed(lostShare < 10 ? 2 : 0)} %)`, lostShare > 1);
  const free = isKnown(health.disk_free_mb) ? `, ${fixed(health.disk_free_mb / 1000, 1, "GB")} free` : "";
  const recording = health.recording_error ? "ERROR" : `${health.recording ? "on" : "off"}${free}`;
  setFact("recording", recording, Boolean(health.recording_error) || !health.recording);
  setFact("faults", faults ? `${count(faults)}: ${Object.keys(health.faults).join(", ")}` : "none");
}

const timeOfDay = (message) => new Date(message.time_ns / 1e6).toTimeString().slice(0, 8);
