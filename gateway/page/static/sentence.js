// The operator's sentence: what happens, and what to expect, in two lines at most.

import {highest} from "./alarm.js";
import {ago, degrees, isKnown} from "./number.js";
import {SOON_S} from "./peak.js";
import {hasText, text} from "./texts.js";

const CERTAIN = 0.95; // probability from which on a cause is named
const PASSING = new Set(["no_reading", "too_short", "undetermined", "turning_point", "clipped_long", undefined]); // they end by themselves
const CAUSES = new Set(["driven", "wind", "hoisting"]);
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
    case "UNKNOWN": return unknownSentence(state);
    case "STALE": return staleSentence(state);
    case "NO DATA": return text(state.gateway ? "starting" : "gateway_gone");
    default: return doing(motion, keep);
  }
}

// Return what acts on the load, if that is all but certain, else what the load is seen to do. No reading of acceleration shows
// whether a crane moves or rests.
function doing(motion, keep) {
  const key = keep("doing", causeKey(motion) ?? seenKey(motion));
  return key === "unknown" ? "" : text(key);
}

function causeKey(motion) {
  if (!(motion?.probabilities?.[motion.state] >= CERTAIN) || !CAUSES.has(motion.state)) return null;
  return motion.state === "hoisting" && motion.hoist_m_s > 0 ? "lowering" : motion.state;
}

const seenKey = (motion) => ({driven: "set_swinging", wind: "set_swinging", hoisting: "free"}[motion?.state] ?? motion?.state ?? "unknown");

// Return why an alarm stands, and what follows: the angle is the one that was compared, or the largest one since the alarm began
// where the angle is low enough for the level to end.
function alarmSentence(alarm, motion, keep, ageS) {
  if (alarm === null) return "";
  const own = `${alarm.rule}_alarm`;
  if (hasText(own) && !isKnown(alarm.limit_deg) && !isKnown(alarm.value_deg)) return text(own); // the calibration has neither
  const isEnding = isKnown(alarm.ends_in_s) && isKnown(alarm.largest_deg);
  const now = hasText(own) ? own : alarm.expected_in_s - ageS > SOON_S ? "alarm_coming" : "alarm_now";
  const form = keep("alarm", isEnding ? "alarm_was" : now);
  return [causeKey(motion) === null ? "" : doing(motion, keep), alarmText(alarm, form === "alarm_was" && !isEnding ? now : form), whatFollows(alarm, ageS)].join(" ").trim();
}

function alarmText(alarm, form) {
  if (!isKnown(alarm.value_deg)) return text("alarm_unknown");
  const limit = text(`at_${alarm.level}`, {angle: degrees(alarm.limit_deg)});
  if (form !== "alarm_was") return text(form, {angle: degrees(alarm.value_deg), limit});
  const angle = degrees(alarm.largest_deg);
  const isBelow = alarm.largest_deg < alarm.limit_deg && angle !== degrees(alarm.limit_deg); // a bound raised it
  return text(isBelow ? "alarm_was_below" : form, {angle, limit});
}

// Return what follows a level, and when, or below which angle.
function whatFollows({next_level: level, next_below_deg: belowDeg, ends_in_s: inS}, ageS) {
  if (!isKnown(belowDeg)) return "";
  if (isKnown(inS)) return text(`${level}_in`, {seconds: Math.max(1, Math.ceil(inS - ageS))});
  return text(`${level}_below`, {angle: degrees(belowDeg)});
}

const isActive = (session) => session?.phase === "collecting" || session?.phase === "review";

// Return the text of a reason by its code; a general one where this page does not know the code.
export const reasonText = (code) => text([`reason_${code}`, `gate_${code}`].find(hasText) ?? "unknown");

function unknownSentence(state) {
  const {motion, condition} = state.topics;
  const codes = motion?.state === "unknown" ? motion.reason_codes : condition?.trusted === false ? condition.reason_codes : null;
  const code = codes?.[0];
  return `${reasonText(code)} ${PASSING.has(code) ? whenBack(state) : knownLast(state)}`.trim();
}

const knownLast = ({last_good: good}) => (good ? text("known_last", {ago: ago(good.age_s)}) : "");

// Return when the swing is usually known again: within a period, unless it has been unknown for longer.
function whenBack(state) {
  const periodS = state.topics.swing?.period_s;
  if (!state.last_good) return text("known_soon");
  if (isKnown(periodS) && state.last_good.age_s < 2 * periodS) return text("back_within", {seconds: Math.ceil(periodS)});
  return knownLast(state);
}

function staleSentence(state) {
  if (!state.gateway) return text("gateway_gone");
  const silentS = state.age_s.tilt ?? Math.max(...Object.values(state.age_s), 0); // others come once in seconds
  if (state.topics.alert?.validity !== "no_samples") return text("no_new_data", {seconds: Math.round(silentS)});
  return isKnown(state.age_s.tilt) ? `${text("reason_no_samples")} ${text("known_last", {ago: ago(silentS)})}` : text("reason_no_samples");
}
