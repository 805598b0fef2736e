// The sentence on the card of a gateway: why it asks for action, from the codes in its status, in the language of the page.

import {sentence} from "./sentence.js";
import {hasText, partName, text} from "./texts.js";

// Return the sentence of a card beside its number; empty where all is well and the limits are those of commissioning.
export function cardSentence({word, alive, causes, motion, authenticated}, value) {
  switch (word) {
    case "OK": return causes.limits_changed ? text("note_limits") : "";
    case "MISSING": return text("fleet_missing");
    case "GONE": return text("gateway_gone");
    case "NOT AUTHENTICATED": return text("fleet_not_authenticated");
    case "DUPLICATE": return text("fleet_duplicate");
    case "FAULT": return text("fleet_fault", {parts: causes.faulty_parts.map(partName).join(", ")});
    case "BATTERY LOW": return text("note_battery");
    case "UNKNOWN": return causes.validity === "no_samples" ? text("reason_no_samples") : doubt(causes) ?? text("unknown");
    case "DISTURBED": return doubt(causes) ?? text("disturbed");
    default: return !authenticated && value === null ? text("fleet_not_authenticated") : sentence({word}, operatorState(alive, causes, motion), value);
  }
}

// Return what the operator's page would know of the gateway.
function operatorState(alive, {alerts, validity, session, age_s: ageS}, motion) {
  return {gateway: alive, age_s: {oldest: ageS}, topics: {motion, alert: {active: alerts, validity}, calibration: {session: {phase: session}}}};
}

// Return why the reading is doubted; null where the gates do not tell.
function doubt({failed_gates: gates}) {
  const told = gates.find((gate) => hasText(`gate_${gate}`));
  return told === undefined ? null : text(`gate_${told}`);
}
