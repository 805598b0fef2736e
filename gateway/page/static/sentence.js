// The operator's sentence: what happens, and what to expect, in two lines at most.

import {ago, degrees, isKnown, upwards} from "./number.js";
import {deciding} from "./peak.js";
import {hasText, text} from "./texts.js";

const ALARMS = ["trip", "warn"];
const asItIs = (_part, form) => form;

// Return the sentence of a verdict. `keep` may hold back a change of what the sentence is about, by part and form;
// `waitedS` is the time since the state arrived.
export function sentence(verdict, state, keep = asItIs, waitedS = 0) {
  const {motion, alert, calibration} = state.topics;
  switch (verdict.word) {
    case "TRIP": case "WARN": return alarmSentence(highest(alert), motion, keep, (state.age_s.alert ?? 0) + waitedS);
    case "SUSPENDED": return text(isActive(calibration?.session) ? "suspended" : "suspended_after");
    case "UNCALIBRATED": return text("uncalibrated");
    case "DISTURBED": return text("disturbed");
    case "UNKNOWN": return `${capital(firstReason(verdict, motion))}. ${whenBack(state)}`;
    case "STALE": return staleSentence(state);
    case "NO DATA": return text(state.gateway ? "starting" : "gateway_gone");
    default: return doing(motion, keep);
  }
}

// Return what crane and load do, as a sentence.
function doing(motion, keep) {
  const key = keep("doing", motionKey(motion));
  return key === "unknown" ? "" : text(key);
}

// Return the key of what crane and load do.
export function motionKey(motion) {
  if (!motion) return "unknown";
  return motion.state === "hoisting" && motion.hoist_m_s > 0 ? "lowering" : motion.state;
}

function highest(alert) {
  const active = alert?.active ?? [];
  for (const level of ALARMS) {
    const found = active.find((one) => one.level === level);
    if (found) return found;
  }
  return null;
}

// Return why an alarm stands, and when it ends: the angle is the upper end of the interval of the big number, or the largest one
// since the alarm began where the swing is low enough for the alarm to end.
function alarmSentence(alarm, motion, keep, ageS) {
  if (alarm === null) return "";
  const limit = degrees(alarm.limit_deg), angle = upwards(alarm.value_deg);
  const clears = isKnown(alarm.clear_deg) ? text("clears", {angle: degrees(alarm.clear_deg)}) : "";
  const own = `${alarm.rule}_alarm`, isOwn = hasText(own);
  if (isOwn && !isKnown(alarm.limit_deg) && !isKnown(alarm.value_deg)) return text(own); // the calibration has neither
  if (!isKnown(alarm.value_deg)) return `${text("alarm_unknown")} ${clears}`;
  if (isOwn) return `${text(own, {angle, limit})} ${clears}`;
  const value = deciding(motion);
  const isEnding = isKnown(alarm.ends_in_s) && isKnown(alarm.largest_deg);
  const form = keep("alarm", isEnding ? "alarm_ending" : value?.inS > 0 ? "alarm_coming" : "alarm_now");
  if (form === "alarm_ending" && isEnding) {
    const seconds = Math.max(0, Math.ceil(alarm.ends_in_s - ageS));
    return `${doing(motion, keep)} ${text("alarm_ending", {angle: degrees(alarm.largest_deg), limit, seconds})}`.trim();
  }
  const shown = form === "alarm_ending" ? "alarm_now" : form;
  const swing = text(shown, {angle: value === null ? angle : upwards(value.angleDeg + value.halfDeg), limit});
  return `${doing(motion, keep)} ${swing} ${clears}`.trim();
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
