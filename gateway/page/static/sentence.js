// The operator's sentence: what to do, what happens, and what to expect, in two lines at most.

import {besides, highest} from "./alarm.js";
import {degrees, isKnown} from "./number.js";
import {hasText, text} from "./texts.js";

const CERTAIN = 0.95; // probability from which on a cause is named
const PASSING = new Set(["no_reading", "too_short", "undetermined", "turning_point", "clipped_long", undefined]); // they end by themselves
const CAUSES = new Set(["driven", "wind", "hoisting"]);
const asItIs = (_part, form) => form;

// Return the sentence of a verdict beside its big number (peak.js; null: not known), which is the only angle: a sentence names limits.
// `keep` may hold back a change of what the sentence is about, by part and form; `waitedS` is the time since the state arrived.
export function sentence(verdict, state, value, keep = asItIs, waitedS = 0) {
  const {motion, calibration} = state.topics;
  const ageS = (topic) => (state.age_s[topic] ?? 0) + waitedS;
  switch (verdict.word) {
    case "TRIP": case "WARN": return alarmSentence(state, value, keep, ageS);
    case "SUSPENDED": return text(isActive(calibration?.session) ? "suspended" : "suspended_after");
    case "UNCALIBRATED": return text("uncalibrated");
    case "DISTURBED": return text("disturbed");
    case "UNKNOWN": return unknownSentence(state);
    case "STALE": return staleSentence(state);
    case "NO DATA": return text(state.gateway ? "starting" : "gateway_gone");
    default: return doing(motion, value, keep);
  }
}

// Return what acts on the load, if that is all but certain, else what the load is seen to do; or that the number is too uncertain to
// be calm about. No reading of acceleration shows whether a crane moves or rests.
function doing(motion, value, keep) {
  const key = keep("doing", isUncertain(value) ? "uncertain" : causeKey(motion) ?? seenKey(motion, value));
  return key === "unknown" ? "" : text(key);
}

// Return whether the number may be beyond the first limit, although the angle itself is below.
function isUncertain(value) {
  const limitDeg = value?.limits.warn_deg ?? value?.limits.trip_deg;
  return isKnown(limitDeg) && isKnown(value.halfDeg) && value.angleDeg + value.halfDeg >= limitDeg;
}

function causeKey(motion) {
  if (!(motion?.probabilities?.[motion.state] >= CERTAIN) || !CAUSES.has(motion.state)) return null;
  return motion.state === "hoisting" && motion.hoist_m_s > 0 ? "lowering" : motion.state;
}

function seenKey(motion, value) {
  if (!motion || motion.state === "unknown") return "unknown";
  return motion.state === "rest" && value?.isResting !== false ? "rest" : "free";
}

// Return what to do and what the number says of the limit; once the alarm nears its end, what ends it instead.
function alarmSentence({topics: {alert, motion, condition}, alert_log: log}, value, keep, ageS) {
  const alarm = highest(alert);
  if (alarm === null) return "";
  const isCorrected = log?.alerts.some((one) => one.incident === alarm.incident && one.is_corrected);
  if (!isKnown(alarm.limit_deg)) return text(`${alarm.rule}_alarm`); // the calibration has none
  const isEnding = isKnown(alarm.ends_in_s), hold = isEnding ? asItIs : keep;
  const form = value === null ? "alarm_unknown" : hold("alarm", alarmForm(alarm, isCorrected, value, motion, ageS("motion")));
  const said = text(form, {limit: text(`at_${alarm.level}`, {angle: degrees(alarm.limit_deg)})});
  const others = besides(alert, alarm).map(({rule}) => `also_${rule}`).filter(hasText).map((key) => text(key)).join(" ");
  if (!form.endsWith("_passed") && !isEnding) return `${text(`do_${alarm.level}`)} ${said} ${others}`.trim();
  return `${said} ${others || (condition?.trusted === false ? text("alarm_stays") : whatFollows(alarm, ageS("alert")))}`.trim();
}

// Return what the number and the largest angle since the alarm began say of its limit.
function alarmForm(alarm, isCorrected, value, motion, ageS) {
  const hasOwn = hasText(`${alarm.rule}_alarm`), halfDeg = value.halfDeg ?? (hasOwn ? 0 : Infinity);
  const isBelow = isKnown(alarm.ends_in_s) || value.angleDeg + halfDeg < alarm.limit_deg;
  if (hasOwn) return isBelow && hasText(`${alarm.rule}_passed`) ? `${alarm.rule}_passed` : `${alarm.rule}_alarm`;
  if (Math.max(alarm.largest_deg ?? 0, motion?.angle_deg ?? 0) >= alarm.limit_deg) {
    return isBelow ? "alarm_exceeded_passed" : "alarm_exceeded";
  }
  if (value.angleDeg - halfDeg >= alarm.limit_deg && value.inS > ageS) return "alarm_coming";
  if (!isBelow) return "alarm_possible";
  return isCorrected ? "alarm_corrected_passed" : "alarm_passed";
}

// Return what follows a level, and when, or below which angle: the gateway compares a part of the uncertainty with it too.
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
  return `${reasonText(code)} ${PASSING.has(code) ? whenBack(state) : ""}`.trim();
}

// Return when the swing is usually known again: within a period, unless it has been unknown for longer.
function whenBack(state) {
  const periodS = state.topics.swing?.period_s;
  if (!state.last_good) return text("known_soon");
  return isKnown(periodS) && state.last_good.age_s < 2 * periodS ? text("back_within", {seconds: Math.ceil(periodS)}) : "";
}

function staleSentence(state) {
  if (!state.gateway) return text("gateway_gone");
  const {tilt, oldest} = state.age_s, silentS = tilt ?? oldest;
  const silence = (seconds) => text("no_new_data", {seconds: Math.max(1, Math.floor(seconds))});
  if (state.topics.alert?.validity !== "no_samples") return silence(silentS ?? Math.max(...Object.values(state.age_s), 0));
  const isTold = state.last_good || !isKnown(silentS); // the number says since when, or the sensor never spoke
  return [text("reason_no_samples"), isTold ? "" : silence(silentS)].join(" ").trim();
}
