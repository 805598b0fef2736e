// The page: shows what the server pushes, and whether it is up to date.

import {Acknowledger, standing} from "./acknowledge.js";
import {shownLean} from "./alarm.js";
import {AlertList} from "./alerts.js";
import {AlignScreen} from "./align.js";
import {Bullseye} from "./bullseye.js";
import {CalibrationScreen} from "./calibration.js";
import {setText, showFacts} from "./facts.js";
import {Gauge} from "./gauge.js";
import {Link, nowS} from "./link.js";
import {Mounting} from "./mounting.js";
import {ago, decimal, degrees, isKnown, nearestDirection, upwards} from "./number.js";
import {operatorNotice, serviceNotices} from "./notices.js";
import {Person} from "./person.js";
import {bigNumber} from "./peak.js";
import {reasonText, sentence} from "./sentence.js";
import {addSymbols} from "./shapes.js";
import {Sound} from "./sound.js";
import {Steady} from "./steady.js";
import {followLanguage, text} from "./texts.js";
import {timeWithZone} from "./time.js";
import {Trend} from "./trend.js";

const LOST = {word: "STALE", colour: "black", shape: "hourglass", sound: false, reasons: []};
const REFRESH_MS = 100;
const TREND_S = 1;
const URGENT = new Set(["TRIP", "WARN", "STALE", "NO DATA", "SUSPENDED"]);
const ANNOUNCE_S = 10; // shortest time between two announcements that ask for no action
const GONE = new Set(["STALE", "NO DATA"]);
const BLIND = new Set([...GONE, "SUSPENDED", "DISTURBED", "UNKNOWN"]); // no number describes the load
const UNMONITORED = new Set([...GONE, "SUSPENDED"]);
const UNKNOWN_SOUNDS_S = 2; // a shorter gap in what is known asks for nothing
const SCREENS = {"#alerts": "alerts", "#service": "service"};
const LEAN_SHOWN_DEG = 0.05; // a smaller lean is shown as 0.0°, which has no direction
const LEAN_SIGNIFICANT = 2; // standard uncertainties from which a lean has a direction
const MAX_REASONS = 8;
const NS_PER_MS = 1e6;

addSymbols();
const element = (id) => document.getElementById(id);
const bullseye = new Bullseye(element("bullseye"));
const gauge = new Gauge(element("gauge"));
const calibration = new CalibrationScreen(element("calibration"));
const align = new AlignScreen(element("align"));
const person = new Person();
const acknowledger = new Acknowledger(person);
const alertList = new AlertList(element("alert-rows"), acknowledger);
const mounting = new Mounting(element("mounting"));
const sound = new Sound([...document.querySelectorAll(".sound")]);
const trend = new Trend(element("trend"), element("trend-labels"), element("trend-times"));
const steady = new Steady(nowS);
let state = null;
let steadyWord = null; // the word whose sentence keeps its form
let trendS = 0;
let announced = null;
let announcedS = -Infinity;
let knownS = nowS(); // when the angle was last known, or never
let wasKnown = false; // of this gateway, or of one before its restart
let shownLast = null; // the last angle that was shown, none that was expected, and when

const link = new Link(
  (history) => {
    trend.take(history);
    person.refresh(); // a gateway that has started again knows nobody
  },
  (pushed) => {
    state = pushed;
    trend.add(pushed.points ?? []);
    show();
  },
  () => trend.known(),
);

// Return the server's verdict with the operator's sentence, or STALE or NO DATA without a connection to the server.
function verdictNow() {
  const complaint = link.complaint();
  if (complaint === null && state !== null) return state.verdict;
  const words = complaint === null ? text("starting") : text(complaint.key, {seconds: complaint.seconds});
  if (state === null) return {...LOST, word: "NO DATA", shape: "empty", sentence: words, also: []};
  const last = state.verdict;
  const also = (GONE.has(last.word) ? last.also : [last.word, ...last.also]).filter((word) => word !== "OK");
  return {...LOST, sentence: words, also};
}

// Return the big number, and put the sentence beside it into the verdict: what is about to be said of the load decides on the number's
// form, which is held as long.
function sayBeside(verdict, topics) {
  const value = bigNumber(verdict, topics, state.page);
  if (verdict.word !== steadyWord) steady.clear();
  steadyWord = verdict.word;
  verdict.sentence ??= sentence(verdict, state, value, steady.keep, link.ageS());
  if (verdict.word === "OK" && steady.shows("doing", "uncertain")) verdict.shape = "ring"; // no tick
  if (GONE.has(verdict.word) && verdict.also.includes("TRIP")) verdict.sentence = `${text("do_trip")} ${verdict.sentence}`;
  const isBound = (steady.shows("bound", "bound") ? value?.staysBound : value?.isBound) && steady.shows("doing", "rest");
  return value && {...value, isBound: value.isResting && steady.keep("bound", isBound ? "bound" : "angle") === "bound"};
}

function show() {
  try {
    if (state !== null) followLanguage(state.page.language);
    const verdict = {...verdictNow()};
    const blind = [verdict.word, ...verdict.also].some((word) => BLIND.has(word));
    const shown = blind ? {} : state?.topics;
    const value = state === null ? null : sayBeside(verdict, shown);
    showVerdict(verdict);
    const alarms = standing(state?.topics.alert);
    sound.update([...unacknowledged(alarms), ...lossOfView(verdict)]);
    if (state === null) return;
    const waitedS = link.ageS();
    const gone = GONE.has(verdict.word);
    acknowledger.show(gone ? [] : alarms);
    person.show(state.page.names);
    showSwing(value, shown, verdict, waitedS);
    showFacts(state, waitedS);
    showReasons(verdict, state.topics, value);
    alertList.show(state.alert_log, gone);
    mounting.draw(state.page.directions);
    showScreens(gone);
    if (gone) bullseye.clear();
    else bullseye.draw(state, value);
    if (nowS() - trendS >= TREND_S) {
      trendS = nowS();
      trend.draw(state.page, state.time_ns + waitedS * 1e9, state.alert_log.alerts);
    }
  } catch (error) {
    const reason = String(error);
    showVerdict({...LOST, word: "UNKNOWN", colour: "grey", shape: "question", sentence: text("page_fault", {reason}), also: []});
    throw error;
  }
}

const unacknowledged = (alarms) =>
  alarms.filter((one) => !one.acknowledged_by).map((one) => ({key: one.incident ?? one.rule, level: one.level}));

// Return the alarm that nobody watches the swing: no gateway, no samples, suspended, or an angle that a disturbance or another cause
// has kept unknown for seconds. A gateway
// that has started again does not end it before it knows the angle.
function lossOfView({word, also}) {
  const words = [word, ...also], isUnmonitored = words.some((one) => UNMONITORED.has(one)), isKnownNow = !words.some((one) => BLIND.has(one));
  wasKnown ||= isKnownNow || Boolean(state?.last_good);
  if (isKnownNow || !wasKnown) knownS = nowS();
  const lost = isUnmonitored || nowS() - knownS > UNKNOWN_SOUNDS_S;
  return lost ? [{key: "view", level: "lost"}] : [];
}

// A recalibration takes precedence over the chosen screen.
function showScreens(gone) {
  const session = state.topics.calibration?.session;
  const recalibrated = Boolean(session?.suspended);
  const aligned = !recalibrated && window.location.hash === "#align";
  const chosen = SCREENS[window.location.hash] ?? "swing";
  document.body.dataset.screen = recalibrated || aligned ? "service" : chosen;
  calibration.show(session, recalibrated, gone);
  align.show(state.align, state.align_turn, aligned, gone);
  for (const name of ["swing", "alerts", "service"]) {
    element(`${name}-screen`).hidden = recalibrated || aligned || name !== chosen;
    if (name === chosen) element(`to-${name}`).setAttribute("aria-current", "page");
    else element(`to-${name}`).removeAttribute("aria-current");
  }
}

function showVerdict(verdict) {
  document.body.dataset.colour = verdict.colour;
  document.body.dataset.word = verdict.word;
  const word = text(`word_${verdict.word}`);
  setText("word", word);
  setText("sentence", verdict.sentence);
  announce(verdict, word);
  const words = verdict.also.map((one) => text(`word_${one}`)).join(", ");
  setText("also", words ? text(GONE.has(verdict.word) ? "last_known" : "also", {words}) : "");
  element("shape").setAttribute("href", `#shape-${verdict.shape}`);
  const name = state?.page.title || state?.page.sensor || "Plumbline";
  setText("title", name);
  const title = `${word} · ${name}`;
  if (document.title !== title) document.title = title;
  const kind = state?.topics.health?.device_kind;
  setText("source", {simulated: "SIMULATION", replay: "REPLAY"}[kind] ?? "");
  setText("time", timeWithZone(Date.now() * 1e6));
}

// Tell a screen reader when the word changes, and not when only a number does; what asks for no action is said rarely.
function announce(verdict, word) {
  const isUrgent = URGENT.has(verdict.word) || URGENT.has(announced);
  if (verdict.word === announced || (!isUrgent && nowS() - announcedS < ANNOUNCE_S)) return;
  announced = verdict.word;
  announcedS = nowS();
  setText("announcement", `${word}. ${verdict.sentence}`);
}

function showReasons(verdict, {condition, motion, health}, value) {
  const list = element("reasons");
  const notices = serviceNotices(health);
  element("to-service").classList.toggle("faulty", notices.length > 0);
  setText("service-faults", notices.length > 0 ? text("service_faults", {count: notices.length}) : "");
  setText("note", operatorNotice(health));
  const words = [verdict.word, ...verdict.also].filter((word) => word !== "OK");
  const codes = [...(condition?.reason_codes ?? []), ...(motion?.reason_codes ?? [])];
  const all = [...notices, ...words.map((word) => sentence({word}, state, value)), ...codes.map(reasonText)];
  const texts = [...new Set(all)].slice(0, MAX_REASONS);
  if (texts.length === 0) texts.push(text("none"));
  if (texts.join("\n") === [...list.children].map((item) => item.textContent).join("\n")) return;
  list.replaceChildren(...texts.map((content) => Object.assign(document.createElement("li"), {textContent: content})));
}

// The number is the one that decides; a small one is shown as its upper end alone.
function showSwing(value, topics, verdict, waitedS) {
  const {motion} = topics;
  document.body.classList.toggle("doubtful", !verdict.sound);
  if (value !== null && verdict.sound) shownLast = {angleDeg: value.inS > 0 ? motion?.angle_deg : value.angleDeg, atS: nowS()};
  setText("angle-title", text(value?.title ?? "deciding_angle"));
  setText("bound", value?.isBound ? "≤ " : "");
  element("word").dataset.number = value === null ? "" : degrees(value.angleDeg);
  setText("phi", value?.isBound ? upwards(value.angleDeg + value.halfDeg) : degrees(value?.angleDeg));
  setText("interval", intervalText(value, (state.age_s.motion ?? 0) + waitedS, waitedS));
  document.body.dataset.sampleMs = isKnown(motion?.time_ns) ? (motion.time_ns / NS_PER_MS).toFixed(1) : "";
  gauge.draw(value?.limits ?? state.page, value, value?.limits.warn_deg === null ? null : motion?.angle_deg);
  showTiles(topics);
}

function intervalText(value, ageS, waitedS) {
  if (value?.isBound) return text("no_swing");
  if (value !== null) {
    const inS = value.inS - ageS, half = value.halfDeg === null ? "" : upwards(value.halfDeg);
    if (inS <= 0) return half && text("plus_minus", {angle: half});
    // no share of the intervals is stated of what is expected: a drive or a gust that begins meanwhile is in none
    return `${half && `± ${half}`}\n${text("expected_in", {seconds: decimal(inS, 1)})}`.trim();
  }
  const {angleDeg, ageS: goneS} = lastNumber(waitedS);
  return isKnown(angleDeg) ? text("was", {angle: degrees(angleDeg), ago: since(goneS)}) : text("never");
}

// Return the last number that stood here, or before that the largest angle that the gateway was sure of, and its age.
function lastNumber(waitedS) {
  if (shownLast !== null) return {angleDeg: shownLast.angleDeg, ageS: nowS() - shownLast.atS};
  return {angleDeg: state.last_good?.phi_max_deg, ageS: (state.last_good?.age_s ?? 0) + waitedS};
}

// Return for how long something is lost: it is not there now, however short that is.
const since = (seconds) => (seconds < 2 ? text("seconds_ago", {count: 1}) : ago(seconds));

function showTiles(topics) {
  const {swing, motion} = topics;
  setText("present", degrees(motion?.angle_deg));
  const leanDeg = shownLean({...topics, alert: state.topics.alert});
  const isDirected = isKnown(leanDeg) && leanDeg >= LEAN_SHOWN_DEG && leanDeg > LEAN_SIGNIFICANT * (motion?.lean_u_deg ?? Infinity);
  setText("lean", degrees(leanDeg));
  const direction = nearestDirection(swing?.lean_azimuth_deg, state.page.directions);
  setText("lean-direction", isDirected ? direction : "");
  const limitDeg = state.page.lean_trip_deg;
  element("tile-lean").classList.toggle("bad", isKnown(leanDeg) && isKnown(limitDeg) && leanDeg >= limitDeg);
}

setInterval(() => {
  link.reconnect();
  show();
}, REFRESH_MS);
window.addEventListener("pageshow", (event) => {
  if (event.persisted) window.location.reload();
});
