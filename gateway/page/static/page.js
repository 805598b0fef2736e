// The page: shows what the server pushes, and whether it is up to date.

import {AlignScreen} from "./align.js";
import {Bullseye} from "./bullseye.js";
import {CalibrationScreen} from "./calibration.js";
import {setText, showFacts} from "./facts.js";
import {Link, nowS} from "./link.js";
import {degrees, direction, fixed, isKnown, NONE, plusMinus, upwards} from "./number.js";
import {Trend} from "./trend.js";

const LOST = {word: "STALE", label: "STALE", colour: "black", shape: "hourglass", sound: false};
const REFRESH_MS = 100;
const TREND_S = 1;
const GONE = new Set(["STALE", "NO DATA"]);

const bullseye = new Bullseye(document.getElementById("bullseye"));
const calibration = new CalibrationScreen(document.getElementById("calibration"));
const align = new AlignScreen(document.getElementById("align"));
const trend = new Trend(document.getElementById("trend"), document.getElementById("trend-labels"));
let state = null;
let trendS = 0;

const link = new Link(
  (history) => trend.replace(history.points),
  (pushed) => {
    state = pushed;
    trend.add(pushed.points ?? []);
    show();
  },
);

// Return the server's verdict, or STALE or NO DATA without a connection to the server.
function verdictNow() {
  const complaint = link.complaint();
  if (complaint === null && state !== null) return state.verdict;
  if (state === null) {
    const reasons = [complaint ?? "waiting for the gateway's page"];
    return {...LOST, word: "NO DATA", label: "NO DATA", shape: "empty", reasons, also: []};
  }
  const last = state.verdict;
  const labels = GONE.has(last.word) ? last.also : [last.label, ...last.also];
  return {...LOST, reasons: [complaint], also: labels.filter((label) => label !== "OK")};
}

function show() {
  try {
    const verdict = verdictNow();
    showVerdict(verdict);
    if (state === null) return;
    const waitedS = nowS() - link.arrivedS;
    const gone = GONE.has(verdict.word);
    showNotices(gone ? [] : notices(state.topics));
    showSwing(gone ? null : state.topics.swing, verdict, waitedS);
    showCondition(gone ? null : state.topics.condition);
    showFacts(state, waitedS);
    showScreens(gone);
    if (gone) bullseye.clear();
    else bullseye.draw(state);
    if (nowS() - trendS >= TREND_S) {
      trendS = nowS();
      trend.draw(state.page);
    }
  } catch (error) {
    showVerdict({...LOST, label: "UNKNOWN", colour: "violet", shape: "question", reasons: [`page: ${error}`], also: []});
    throw error;
  }
}

// A recalibration takes precedence over the alignment, and both over the swing.
function showScreens(gone) {
  const session = state.topics.calibration?.session;
  const recalibrated = Boolean(session?.suspended);
  const aligned = !recalibrated && window.location.hash === "#align";
  calibration.show(session, recalibrated, gone);
  align.show(state.align, aligned, gone);
  document.querySelector("main").hidden = recalibrated || aligned;
}

function showVerdict(verdict) {
  document.body.dataset.colour = verdict.colour;
  document.body.dataset.word = verdict.word;
  setText("word", verdict.label);
  const gone = GONE.has(verdict.word);
  setText("also", verdict.also.length > 0 ? `${gone ? "last known: " : "and "}${verdict.also.join(", ")}` : "");
  setText("reasons", verdict.word === "OK" ? "fresh, trusted, calibrated" : reasonsBesideList(verdict).join("; "));
  document.getElementById("shape").setAttribute("href", `#shape-${verdict.shape}`);
  const name = state?.page.title || state?.page.sensor || "Plumbline";
  setText("title", name);
  const title = `${verdict.label} · ${name}`;
  if (document.title !== title) document.title = title;
  const kind = state?.topics.health?.device_kind;
  setText("source", {simulated: "SIMULATION", replay: "REPLAY"}[kind] ?? "");
}

// Omit the text of the alert where the list of alerts or the other reasons contain it.
function reasonsBesideList(verdict) {
  if (GONE.has(verdict.word)) return verdict.reasons;
  const others = verdict.reasons.filter((reason) => reason !== state?.topics.alert?.text);
  const listed = verdict.word === "WARN" || verdict.word === "TRIP";
  return listed || others.length > 0 ? others : verdict.reasons;
}

// Return the active alerts with their duration, and further notices.
function notices({alert, health}) {
  const active = (alert?.active ?? []).filter((one) => one.level === "warn" || one.level === "trip");
  const texts = active.map((one) => {
    const activeS = Math.max(Math.round((alert.time_ns - one.since_ns) / 1e9), 0);
    return `${one.text} · ${activeS} s`;
  });
  if (health?.recording_error) texts.push(`not recording: ${health.recording_error}`);
  if (health && health.state !== "running") texts.push(`gateway ${health.state}`);
  return texts;
}

function showNotices(texts) {
  const list = document.getElementById("alerts");
  if (texts.join("\n") === [...list.children].map((item) => item.textContent).join("\n")) return;
  list.replaceChildren(...texts.map((text) => Object.assign(document.createElement("li"), {textContent: text})));
}

function showSwing(swing, verdict, waitedS) {
  const known = Boolean(swing) && state.swing_known;
  document.body.classList.toggle("doubtful", !verdict.sound);
  setText("doubt", known && !verdict.sound ? "?" : "");
  if (!known) {
    setText("bound", "");
    setText("phi", NONE);
    setText("interval", lastGood(waitedS));
  } else if (swing.swinging) {
    setText("bound", "");
    setText("phi", degrees(swing.phi_max_deg));
    setText("interval", `${plusMinus(swing.phi_max_deg, swing.coverage95_deg)} (95 %)`);
  } else {
    setText("bound", "≤ ");
    setText("phi", upwards(swing.coverage95_deg[1]));
    setText("interval", "no swing detected");
  }
  showTiles(swing, waitedS);
}

function lastGood(waitedS) {
  const good = state.last_good;
  if (!good || !isKnown(good.phi_max_deg)) return "not known";
  return `not known; was ${degrees(good.phi_max_deg)} ${Math.round(good.age_s + waitedS)} s ago`;
}

function showTiles(swing, waitedS) {
  const peakS = isKnown(swing?.time_to_peak_s) ? swing.time_to_peak_s - (state.age_s.swing ?? 0) - waitedS : null;
  const coming = isKnown(swing?.predicted_phi_max_deg) && peakS !== null && peakS > 0;
  setText("coming", coming ? degrees(swing.predicted_phi_max_deg) : NONE);
  setText("coming-when", coming ? `in ${peakS.toFixed(1)} s` : "");
  setText("lean", degrees(swing?.lean_deg));
  setText("lean-direction", isKnown(swing?.lean_azimuth_deg) ? `toward ${direction(swing.lean_azimuth_deg)}` : "");
  const limit = state.page.lean_trip_deg;
  const beyond = isKnown(swing?.lean_deg) && isKnown(limit) && swing.lean_deg >= limit;
  document.getElementById("lean-tile").classList.toggle("bad", beyond);
  setText("period", fixed(swing?.period_s, 1, "s"));
  setText("azimuth", isKnown(swing?.azimuth_deg) ? `along ${direction(swing.azimuth_deg)}` : "");
}

function showCondition(condition) {
  setText("condition", condition ? condition.verdict.replace("_", " ") : NONE);
  setText("trust", condition ? (condition.trusted ? "trusted" : "not trusted") : "");
  document.getElementById("condition-tile").classList.toggle("bad", Boolean(condition) && !condition.trusted);
  document.getElementById("condition-tile").title = condition ? condition.reasons.join("; ") : "";
}

setInterval(() => {
  link.reconnect();
  show();
}, REFRESH_MS);
window.addEventListener("pageshow", (event) => {
  if (event.persisted) window.location.reload();
});
