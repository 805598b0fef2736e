// The rigger's screen during a recalibration: what to do now, the next attitude, and for how long to hold it. Read-only.

import {drawBox, drawDone} from "./box.js";
import {setText} from "./facts.js";
import {isKnown} from "./number.js";
import {reasonText} from "./sentence.js";
import {text} from "./texts.js";

const FACES = ["+x", "-x", "+y", "-y", "+z", "-z"];
const TITLES = {collecting: "rigger_look", review: "rigger_taken"};

export class CalibrationScreen {
  constructor(section) {
    this.section = section;
    this.drawn = "";
  }

  show(session, wanted, gone) {
    this.section.hidden = !wanted;
    if (!wanted) return;
    setText("next-title", text(TITLES[session.phase] ?? "rigger_ended"));
    this.picture(session);
    setText("next-face", session.phase === "collecting" ? upText(session) : "");
    showDoing(session, gone);
    showPoses(session);
    setText("session-text", gone ? text("rigger_no_contact") : whatNext(session));
    setText("session-who", session.by ? text("rigger_by", {method: text(`method_${session.method}`), by: session.by}) : "");
  }

  // Draw only when the picture changes.
  picture(session) {
    const up = session.phase === "collecting" ? session.next_direction : null;
    const accepted = session.phase === "review" && session.reasons.length === 0;
    const drawn = `${session.phase} ${up} ${accepted}`;
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const svg = document.getElementById("pictogram");
    if (up) drawBox(svg, up);
    else if (accepted) drawDone(svg);
    else svg.replaceChildren();
    svg.setAttribute("aria-label", up ? upText(session) : session.phase);
  }
}

function upText(session) {
  if (session.next_face) return text("rigger_face_up", {face: session.next_face});
  return session.next_direction ? text("rigger_as_picture") : "";
}

function whatNext(session) {
  if (session.phase === "collecting") {
    const hints = session.hints ?? [], next = hints.filter((code) => code !== "pose_taken"); // what to do now says it, too
    return [...new Set((next.length > 0 ? next : hints).map(reasonText))].join(" ");
  }
  if (session.phase === "review") return text(session.committable ? "rigger_review" : "rigger_refused");
  return text("rigger_left");
}

// "Hold still" only while a pose is being taken: a sensor that rests on a face that is already taken must be turned.
function showDoing(session, gone) {
  const collecting = session.phase === "collecting" && !gone;
  const holding = collecting && session.still && isKnown(session.seconds_left);
  const still = document.getElementById("still");
  still.dataset.state = collecting ? (holding ? "still" : "moving") : "done";
  setText("still", doingText(session, collecting, holding));
  setText("seconds-left", holding ? text("rigger_for", {seconds: Math.ceil(session.seconds_left)}) : "");
  document.getElementById("pose-bar").style.width = `${collecting ? Math.round(100 * session.pose_fraction) : 0}%`;
}

function doingText(session, collecting, holding) {
  if (holding) return text("rigger_hold");
  if (!collecting) return text(session.phase === "review" ? "rigger_wait" : "rigger_stopped");
  if (session.next_face) return text("rigger_turn", {face: session.next_face.toUpperCase()});
  return text(session.next_direction ? "rigger_turn_picture" : "rigger_wait");
}

function showPoses(session) {
  const used = session.poses.filter((pose) => pose.used);
  const byFace = session.method === "six-position";
  const taken = byFace ? FACES.filter((name) => used.some((pose) => pose.face === name)) : used;
  const wanted = byFace ? FACES.length : Math.max(session.wanted, taken.length);
  setText("poses-title", text("rigger_poses", {count: taken.length, wanted}));
  const entries = byFace
    ? FACES.map((name) => [name, taken.includes(name) ? "taken" : name === session.next_face ? "wanted" : ""])
    : [];
  const key = JSON.stringify(entries);
  const list = document.getElementById("poses");
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...entries.map(([name, css]) =>
    Object.assign(document.createElement("li"), {textContent: name, className: css})));
}
