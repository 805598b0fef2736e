// The operator's sentence: what happens, and what to expect, in two lines at most. A pure function of the state.

import {ago, degrees, isKnown, upwards} from "./number.js";
import {hasText, text} from "./texts.js";

const ALARMS = ["trip", "warn"];
const SOON_S = 0.05; // a peak that comes sooner is the present angle

// Return the sentence of a verdict.
export function sentence(verdict, state) {
  const {motion, alert, calibration} = state.topics;
  switch (verdict.word) {
    case "TRIP": case "WARN": return alarmSentence(highest(alert), motion);
    case "SUSPENDED": return text(isActive(calibration?.session) ? "suspended" : "suspended_after");
    case "UNCALIBRATED": return text("uncalibrated");
    case "DISTURBED": return text("disturbed");
    case "UNKNOWN": return `${capital(firstReason(verdict, motion))}. ${whenBack(state)}`;
    case "STALE": return staleSentence(state);
    case "NO DATA": return text(state.gateway ? "starting" : "gateway_gone");
    default: return [doing(motion), swingWords(motion)].filter(Boolean).join(" ");
  }
}

// Return what crane and load do, as a sentence.
export function doing(motion) {
  const key = motionKey(motion);
  return key === "unknown" ? "" : text(key);
}

// Return the key of what crane and load do.
export function motionKey(motion) {
  if (!motion) return "unknown";
  return motion.state === "hoisting" && motion.hoist_m_s > 0 ? "lowering" : motion.state;
}

function swingWords(motion) {
  if (!isKnown(motion?.phi_max_deg) || motion.state === "rest") return "";
  return text("swing_is", {angle: degrees(motion.phi_max_deg)});
}

function highest(alert) {
  const active = alert?.active ?? [];
  for (const level of ALARMS) {
    const found = active.find((one) => one.level === level);
    if (found) return found;
  }
  return null;
}

function alarmSentence(alarm, motion) {
  if (alarm === null) return "";
  const limit = degrees(alarm.limit_deg), angle = upwards(alarm.value_deg);
  const clears = isKnown(alarm.clear_deg) ? text("clears", {angle: degrees(alarm.clear_deg)}) : "";
  const own = `${alarm.rule}_alarm`, isOwn = hasText(own);
  if (isOwn && !isKnown(alarm.limit_deg) && !isKnown(alarm.value_deg)) return text(own); // the calibration has neither
  if (!isKnown(alarm.value_deg)) return `${text("alarm_unknown")} ${clears}`;
  if (isOwn) return `${text(own, {angle, limit})} ${clears}`;
  const peak = comingPeak(motion);
  const coming = peak !== null && peak.inS > SOON_S && peak.angleDeg > (motion.phi_max_deg ?? 0);
  const swing = coming ? text("alarm_coming", {angle: upwards(peak.angleDeg), limit}) : text("alarm_now", {angle, limit});
  return `${doing(motion)} ${swing} ${clears}`.trim();
}

// Return the next peak as alerts judge it (MotionEstimate.expected_peak): halfway between a pivot that keeps its acceleration and
// one that coasts, at the time of the larger of both; null where it is not known.
export function comingPeak(motion) {
  const peaks = [
    {angleDeg: motion?.predicted_phi_max_deg, inS: motion?.time_to_peak_s},
    {angleDeg: motion?.coasting_phi_max_deg, inS: motion?.coasting_time_to_peak_s},
  ].filter((peak) => isKnown(peak.angleDeg) && isKnown(peak.inS));
  if (peaks.length < 2) return peaks[0] ?? null;
  const [kept, coasting] = peaks;
  return {
    angleDeg: (kept.angleDeg + coasting.angleDeg) / 2,
    inS: kept.angleDeg >= coasting.angleDeg ? kept.inS : coasting.inS,
  };
}

const isActive = (session) => session?.phase === "collecting" || session?.phase === "review";

function firstReason(verdict, motion) {
  const reason = motion?.state === "unknown" ? motion.reasons[0] : verdict.reasons[0];
  return reason ?? "no reason given";
}

const capital = (words) => words.charAt(0).toUpperCase() + words.slice(1);

// Return when the swing is usually known again: within a period, unless it has been unknown for longer.
function whenBack({topics: {swing}, last_good: good}) {
  const periodS = swing?.period_s;
  if (!good) return text("known_soon");
  if (isKnown(periodS) && good.age_s < 2 * periodS) return text("back_within", {seconds: Math.ceil(periodS)});
  return text("known_last", {ago: ago(good.age_s)});
}

function staleSentence(state) {
  if (!state.gateway) return text("gateway_gone");
  const silentS = state.age_s.tilt ?? Math.max(...Object.values(state.age_s), 0); // others come once in seconds
  return text("no_new_data", {seconds: Math.round(silentS)});
}
