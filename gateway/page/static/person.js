// The person at this screen: signed in with name and PIN, or read-only.

import {setText} from "./facts.js";
import {post, reasonOf} from "./post.js";
import {text} from "./texts.js";

const DELETE = "⌫";
const DIGITS = ["1", "2", "3", "4", "5", "6", "7", "8", "9", "", "0", DELETE];
const LETTERS = [..."ABCDEFGHIJKLMNOPQRSTUVWXY", "", "Z", ".", " ", DELETE];
const ASK_MS = 60000; // a session can expire

const element = (id) => document.getElementById(id);

export class Person {
  constructor() {
    this.name = null;
    this.after = null; // what to do after signing in
    this.offered = "";
    this.dialog = element("sign-in");
    element("sign-in-form").addEventListener("submit", (event) => { event.preventDefault(); this.signIn(); });
    element("sign-in-cancel").addEventListener("click", () => this.dialog.close());
    element("sign").addEventListener("click", () => (this.name === null ? this.ask() : this.signOut()));
    // The next person finds the name of nobody else.
    this.dialog.addEventListener("close", () => { element("sign-in-name").value = element("sign-in-pin").value = ""; });
    element("sign-in-name").addEventListener("click", () => makeKeypad(element("sign-in-name"), LETTERS));
    element("sign-in-pin").addEventListener("focus", () => makeKeypad(element("sign-in-pin"), DIGITS));
    this.refresh();
    setInterval(() => this.refresh(), ASK_MS);
  }

  async refresh() {
    try {
      this.name = (await (await fetch("api/session")).json()).name;
    } catch {
      return; // the connection is lost, which the page shows
    }
  }

  // Show who is signed in, and the names that are offered.
  show(names) {
    setText("person", this.name === null ? text("person_none") : text("person_is", {name: this.name}));
    setText("sign", text(this.name === null ? "sign_in" : "sign_out"));
    if (this.offered === names.join("\n")) return;
    this.offered = names.join("\n");
    element("sign-in-names").replaceChildren(...names.map((name) => {
      const button = Object.assign(document.createElement("button"), {type: "button", textContent: name});
      button.addEventListener("click", () => { element("sign-in-name").value = name; element("sign-in-pin").focus(); });
      return button;
    }));
  }

  // Open the dialog; `after`, the acknowledgement of the alarms `what` that asked for it, is carried out once the PIN was right.
  ask(after = null, what = "") {
    this.after = after;
    setText("sign-in-what", what);
    setText("sign-in-error", "");
    setText("sign-in-title", text(after === null ? "sign_in" : "sign_in_title"));
    setText("sign-in-submit", text(after === null ? "sign_in" : "acknowledge"));
    window.scrollTo(0, 0); // to the big number, on a phone
    if (!this.dialog.open) this.dialog.showModal();
    element("sign-in-name").focus();
    if (this.offered === "") makeKeypad(element("sign-in-name"), LETTERS);
    else makeKeypad(element("sign-in-pin"), DIGITS);
  }

  async signIn() {
    const name = element("sign-in-name").value.trim();
    if (!name) {
      setText("sign-in-error", text("name_missing"));
      element("sign-in-name").focus();
      return;
    }
    const answer = await post("api/sign-in", {name, pin: element("sign-in-pin").value});
    if (!answer.ok) {
      setText("sign-in-error", reasonOf(answer));
      element("sign-in-pin").value = "";
      element("sign-in-pin").focus();
      return;
    }
    this.name = answer.content.name;
    this.dialog.close();
    this.after?.();
  }

  async signOut() {
    await post("api/sign-out", {});
    this.name = null;
  }
}

// Put the keys of a field on a touch panel without a keyboard.
function makeKeypad(field, keys) {
  const keypad = element("keypad");
  keypad.classList.toggle("letters", keys === LETTERS);
  keypad.replaceChildren(...keys.map((key) => {
    if (!key) return document.createElement("span");
    const button = Object.assign(document.createElement("button"), {type: "button", textContent: key === " " ? "␣" : key});
    if (key === DELETE) button.setAttribute("aria-label", text("delete"));
    if (key === " ") button.setAttribute("aria-label", text("space"));
    button.addEventListener("click", () => {
      field.value = key === DELETE ? field.value.slice(0, -1) : (field.value + key).slice(0, field.maxLength);
    });
    return button;
  }));
}
