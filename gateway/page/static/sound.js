// The alarm tone: a fast series for the limit, one long low tone where the swing is not monitored, two tones for a warning; until
// somebody acknowledges the alarm, the operator silences it on this screen, or it ends. Losing the gateway ends none.
// A browser plays sound only after somebody has touched the page, wherever that is; the buttons, beside the alarm and in the dialog that
// covers it, say whether the tone can be heard, and in words what a press does to one that sounds, or that somebody has silenced it.

import {text} from "./texts.js";

const PATTERNS = {
  warn: {everyS: 4, tones_hz: [660, 550], lengthS: 0.25},
  lost: {everyS: 2.5, tones_hz: [370], lengthS: 0.8},
  trip: {everyS: 1.5, tones_hz: [880, 880, 880], lengthS: 0.15},
};
const RANK = {warn: 1, lost: 2, trip: 3};
const LOUDNESS = 0.35;
const RAMP_S = 0.01; // avoids clicks

export class Sound {
  constructor(buttons) {
    this.buttons = buttons;
    this.context = null;
    this.alarms = new Map(); // level by alert
    this.silenced = new Map();
    this.lastS = -Infinity;
    this.lastLevel = null; // of the tone before
    for (const button of buttons) button.addEventListener("click", () => this.press());
    for (const touch of ["click", "keydown"]) {
      document.addEventListener(touch, ({target}) => { if (!target.closest?.(".sound")) this.turnOn(); }, {capture: true});
    }
  }

  // Note the active alerts: identity and level of each.
  update(active) {
    this.alarms = new Map(active.map((one) => [one.key, one.level]));
    for (const key of this.silenced.keys()) if (!this.alarms.has(key)) this.silenced.delete(key);
    const level = this.level();
    const audible = this.context?.state === "running";
    const isSilenced = audible && !level && this.alarms.size > 0;
    const word = !audible ? text("mute") : level ? text("silence") : isSilenced ? text("silenced") : "";
    const label = !audible ? text("sound_off") : word || text("sound_on");
    const icon = level && audible ? "#sound-sounding" : audible && !isSilenced ? "#sound-on" : "#sound-off";
    for (const button of this.buttons) {
      button.dataset.state = level ? "alarm" : audible ? "on" : "off";
      if (button.getAttribute("aria-label") !== label) show(button, word, label, icon);
    }
    if (level && audible) this.play(level);
  }

  // Return the highest level that is not silenced. A warning that becomes a trip sounds again.
  level() {
    let highest = null;
    for (const [key, level] of this.alarms) {
      const silenced = RANK[this.silenced.get(key)] ?? 0;
      if (RANK[level] > silenced && RANK[level] > (RANK[highest] ?? 0)) highest = level;
    }
    return highest;
  }

  // The first press turns the sound on, whatever stands: a new context may run at once.
  press() {
    if (this.context?.state === "running") {
      this.silenced = new Map(this.alarms);
      return;
    }
    this.turnOn();
  }

  turnOn() {
    this.context ??= new AudioContext();
    this.context.resume();
  }

  // A higher level than before waits for no pause.
  play(level) {
    const {everyS, tones_hz, lengthS} = PATTERNS[level], nowS = this.context.currentTime;
    if (nowS - this.lastS < everyS && !(RANK[level] > RANK[this.lastLevel])) return;
    [this.lastS, this.lastLevel] = [nowS, level];
    tones_hz.forEach((frequency_hz, i) => this.tone(frequency_hz, nowS + 1.4 * i * lengthS, lengthS));
  }

  tone(frequency_hz, startS, lengthS) {
    const oscillator = new OscillatorNode(this.context, {frequency: frequency_hz, type: "square"});
    const volume = new GainNode(this.context, {gain: 0});
    volume.gain.setValueAtTime(0, startS);
    volume.gain.linearRampToValueAtTime(LOUDNESS, startS + RAMP_S);
    volume.gain.setValueAtTime(LOUDNESS, startS + lengthS - RAMP_S);
    volume.gain.linearRampToValueAtTime(0, startS + lengthS);
    oscillator.connect(volume).connect(this.context.destination);
    oscillator.start(startS);
    oscillator.stop(startS + lengthS);
  }
}

// Show on a button what it says, and what that is to a screen reader.
function show(button, word, label, icon) {
  button.classList.toggle("worded", word !== "");
  button.querySelector("span").textContent = word;
  button.querySelector("use").setAttribute("href", icon);
  button.setAttribute("aria-label", label);
  button.title = label;
}
