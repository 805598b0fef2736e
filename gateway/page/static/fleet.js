// The page of a site: a card for each crane in the order of the server, what asks for action first.

import {cardSentence} from "./card_sentence.js";
import {Link} from "./link.js";
import {ago, degrees, NONE, upwards} from "./number.js";
import {bigNumber} from "./peak.js";
import {addSymbols} from "./shapes.js";
import {followLanguage, partName, text} from "./texts.js";
import {timeWithZone} from "./time.js";
import {setText} from "./facts.js";

const REFRESH_MS = 250;
const GONE = new Set(["GONE", "MISSING"]);
const CALM = new Set(["OK", "UNKNOWN", "DISTURBED"]); // they ask for no action

addSymbols();
const element = (id) => document.getElementById(id);
const cards = new Map(); // elements by key, which stay while their content changes
let state = null;
let announced = null;

const link = new Link(() => {}, (pushed) => { state = pushed; show(); });

function show() {
  if (state !== null) followLanguage(state.page.language);
  const complaint = link.complaint();
  const notice = complaint !== null ? text(complaint.key, {seconds: complaint.seconds}) : state === null ? text("starting")
    : !state.connected ? text("fleet_no_router") : state.gateways.length === 0 ? text("fleet_none") : "";
  setText("notice", notice);
  document.body.classList.toggle("old", complaint !== null || !state?.connected);
  setText("time", timeWithZone(Date.now() * 1e6));
  if (state === null) return;
  const acting = state.gateways.filter((gateway) => !CALM.has(gateway.word)).length;
  const summary = text("fleet_summary", {count: state.gateways.length, acting});
  setText("summary", summary);
  announce(notice || summary);
  showCards(state.gateways);
}

function showCards(gateways) {
  const order = gateways.map((gateway) => gateway.key);
  for (const [key, card] of cards) if (!order.includes(key)) { card.remove(); cards.delete(key); }
  for (const gateway of gateways) {
    if (!cards.has(gateway.key)) cards.set(gateway.key, makeCard());
    fill(cards.get(gateway.key), gateway);
  }
  const list = element("cards");
  if ([...list.children].some((card, i) => card !== cards.get(order[i])) || list.children.length !== order.length) {
    const focused = document.activeElement;
    list.replaceChildren(...order.map((key) => cards.get(key)));
    if (focused?.isConnected) focused.focus(); // a card that moves keeps the focus
  }
}

function makeCard() {
  const card = document.createElement("li");
  const part = (name, css) => Object.assign(document.createElement(name), {className: css});
  const band = part("p", "state");
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("aria-hidden", "true");
  svg.append(document.createElementNS("http://www.w3.org/2000/svg", "use"));
  band.append(svg, document.createElement("strong"), part("span", "last"));
  const foot = part("p", "foot");
  foot.append(part("span", "swing"), part("span", "expected"), part("span", "doubt"), part("span", "source"), part("span", "age"));
  card.append(part("h2", "name"), band, part("p", "why"), foot);
  card.prepend(band);
  return card;
}

function fill(card, gateway) {
  const set = (selector, content) => {
    const found = card.querySelector(selector);
    if (found.textContent !== content) found.textContent = content;
  };
  card.dataset.colour = gateway.colour;
  card.querySelector("use").setAttribute("href", `#shape-${gateway.shape}`);
  set(".state strong", text(`word_${gateway.word}`));
  set(".last", gateway.last_alarm === null ? "" : text("last_known", {words: text(`word_${gateway.last_alarm}`)}));
  set(".source", gateway.source);
  set(".doubt", besides(gateway).join(", "));
  fillName(card.querySelector(".name"), gateway);
  const value = bigNumber({sound: true}, {motion: gateway.motion, alert: {active: gateway.causes.alerts}}, {}); // a doubtful motion is not sent
  set(".why", cardSentence(gateway, value));
  set(".swing", angleText(value));
  set(".expected", value?.inS > 0 ? text("expected") : "");
  set(".age", gateway.word === "STALE" ? "" : gateway.seen_s === null ? text("fleet_never_seen") : ago(gateway.seen_s));
}

// Return what is wrong with a gateway beside the word of its card.
function besides({authenticated, word, causes: {faulty_parts: parts}}) {
  const isFaulty = parts.length > 0 && word !== "FAULT" && !GONE.has(word);
  const faults = isFaulty ? [`${text("word_FAULT")}: ${parts.map(partName).join(", ")}`] : [];
  return [...(authenticated || word === "NOT AUTHENTICATED" ? [] : [text("word_NOT AUTHENTICATED")]), ...faults];
}

// The card links to the crane's own page where its address is known.
function fillName(heading, {site, crane, sensor, page}) {
  const name = `${site} / ${crane} / ${sensor}`;
  const linked = heading.querySelector("a");
  if (heading.textContent === name && (linked?.getAttribute("href") ?? null) === page) return;
  if (page === null) heading.textContent = name;
  else heading.replaceChildren(Object.assign(document.createElement("a"), {href: page, textContent: name, rel: "noopener noreferrer"}));
}

// The number is that of the crane's own page.
function angleText(value) {
  if (value === null) return NONE;
  return value.isBound ? `≤ ${upwards(value.angleDeg + value.halfDeg)}` : degrees(value.angleDeg);
}

// Tell a screen reader when the number of cranes that ask for action changes.
function announce(words) {
  if (words === announced) return;
  announced = words;
  setText("announcement", words);
}

setInterval(() => {
  link.reconnect();
  show();
}, REFRESH_MS);
