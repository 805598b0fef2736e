// The rigger's screen during a recalibration: the next attitude, whether the sensor is still, and for how long. Read-only.

import {drawBox, drawDone} from "./box.js";
import {setText} from "./facts.js";
import {isKnown} from "./number.js";

const FACES = ["+x", "-x", "+y", "-y", "+z", "-z"];
const TITLES = {collecting: "turn the sensor like this", review: "all poses are taken", rejected: "the session has ended"};

export class CalibrationScreen {
  constructor(section) {
    this.section = section;
    this.drawn = "";
  }

  show(session, wanted, gone) {
    this.section.hidden = !wanted;
    if (!wanted) return;
    setText("next-title", TITLES[session.phase] ?? session.phase);
    this.picture(session);
    setText("next-face", session.phase === "collecting" ? upText(session) : "");
    showDoing(session, gone);
    showPoses(session);
    setText("session-text", gone ? "no contact with the gateway" : session.text);
    showNotes(session);
    setText("session-who", session.by ? `${session.method}, requested by ${session.by}; the old record stays in force until the commit` : "");
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
  if (session.next_face) return `${session.next_face} up`;
  return session.next_direction ? "as in the picture" : "";
}

function showDoing(session, gone) {
  const still = document.getElementById("still");
  const collecting = session.phase === "collecting" && !gone;
  still.dataset.state = collecting ? (session.still ? "still" : "moving") : "done";
  setText("still", collecting ? (session.still ? "STILL" : "MOVING") : session.phase.toUpperCase());
  const leftS = collecting ? session.seconds_left : null;
  setText("seconds-left", isKnown(leftS) ? `hold for ${Math.ceil(leftS)} s` : "");
  document.getElementById("pose-bar").style.width = `${collecting ? Math.round(100 * session.pose_fraction) : 0}%`;
}

function showPoses(session) {
  const used = session.poses.filter((pose) => pose.used);
  const byFace = session.method === "six-position";
  const taken = byFace ? FACES.filter((name) => used.some((pose) => pose.face === name)) : used;
  setText("poses-title", `poses taken: ${taken.length} of ${byFace ? FACES.length : Math.max(session.wanted, taken.length)}`);
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

function showNotes(session) {
  const list = document.getElementById("session-notes");
  const texts = [...session.reasons, ...session.notes].slice(0, 4);
  if (texts.join("\n") === [...list.children].map((item) => item.textContent).join("\n")) return;
  list.replaceChildren(...texts.map((text) => Object.assign(document.createElement("li"), {textContent: text})));
}
