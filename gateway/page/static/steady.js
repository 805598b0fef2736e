// Holds what a text is about for a time, so that it can be read; that the load rests is said once it has rested for as long.

const HELD_S = 2;
const YIELDING = new Set(["rest", "bound", "alarm_coming"]); // not held against a number that denies them
const SLOW = new Set(["rest"]);
const PRESSING = new Set(["uncertain", "alarm_exceeded", "alarm_coming"]); // said at once
const WEAKER = {alarm_coming: "alarm_possible"}; // denies nothing of what was said

export class Steady {
  constructor(clockS) {
    this.clockS = clockS;
    this.forms = new Map();
    this.awaited = new Map(); // slow forms that are asked for, and since when
  }

  // Return the form of a part that was given first within the last seconds.
  keep = (part, form) => {
    const now = this.clockS();
    const held = this.forms.get(part);
    if (!SLOW.has(form) || held === undefined || held.form === form) this.awaited.delete(part);
    else if (now - this.askedS(part, now) < HELD_S) return held.form;
    if (held !== undefined && held.form !== form && !PRESSING.has(form) && !this.yields(held.form, form) && now - held.sinceS < HELD_S) return held.form;
    if (held?.form !== form) this.forms.set(part, {form, sinceS: now});
    return form;
  };

  // Return whether a form gives way at once to another one that is true.
  yields(held, form) {
    return YIELDING.has(held) && WEAKER[held] !== form;
  }

  // Return since when a slow form has been asked for without a break.
  askedS(part, now) {
    if (!this.awaited.has(part)) this.awaited.set(part, now);
    return this.awaited.get(part);
  }

  // Return whether a part has a form now.
  shows(part, form) {
    return this.forms.get(part)?.form === form;
  }

  // Begin anew.
  clear() {
    this.forms.clear();
    this.awaited.clear();
  }
}
