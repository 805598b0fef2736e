// The texts of the page in every language. A test checks that all tables have the same keys and places for values.

const TABLES = {
  en: {
    swing: "Swing", alerts: "Alerts", service: "Service", screens: "screens", status: "status", local_time: "local time",
    largest_angle: "largest swing angle of the last period", from_above: "seen from above", last_ten_minutes: "last 10 minutes",
    next_peak: "next peak", lean: "lean", crane: "crane", measurement: "measurement", reasons: "reasons", mounting: "how the housing hangs",
    align: "Align the housing", now: "now",

    word_OK: "OK", word_WARN: "WARNING", word_TRIP: "LIMIT", word_UNKNOWN: "NOT KNOWN", word_DISTURBED: "DISTURBED",
    word_UNCALIBRATED: "UNCALIBRATED", word_SUSPENDED: "SUSPENDED", word_STALE: "STALE", "word_NO DATA": "NO DATA",
    word_MISSING: "MISSING", word_GONE: "GONE", word_DUPLICATE: "TWO OF ONE NAME", word_FAULT: "FAULT", "word_BATTERY LOW": "BATTERY LOW",
    fleet_title: "Cranes", fleet_summary: "{acting} of {count} ask for action", fleet_no_router: "No connection to the router: the list is old.",
    fleet_none: "No gateway answers.", fleet_never_seen: "never seen",
    fleet_missing: "Expected, and never seen.", fleet_duplicate: "Two gateways use this name at the same time.",
    fleet_fault: "Does not work: {parts}.", fleet_no_samples: "No readings come from the sensor.", fleet_unknown: "The swing is not known at present.",
    gate_complete: "More than a tenth of the readings is missing.", gate_axes_alive: "An axis of the sensor reads exactly zero.",
    gate_not_clipped: "A reading reached the end of the sensor's range.", gate_no_impact: "An impact.", gate_not_shaken: "The vibration is too strong.",
    gate_norm_hanging: "The force is not that of a hanging load.", gate_explained: "No motion of crane and load explains the readings.",
    gate_no_spin: "The housing turns about the rope.", gate_rate_pendulum: "The housing turns faster than the rope swings.",
    part_device: "sensor", part_recording: "recording", part_relay: "relay", part_bus: "network", part_page: "the crane's page", part_page_pin: "PIN of the page",
    part_outbox: "storage of alerts", part_chain: "chain of recordings", part_signing: "signing of recordings", part_identity: "name of the gateway", part_clock: "clock", part_state_files: "state files",
    part_sampler: "reading of the sensor", part_processor: "evaluation", part_recorder: "writing of recordings", part_publisher: "sending of messages", part_alerts: "sending of alerts",
    "part_outbox-writer": "storing of alerts", part_rpc: "remote commands", "part_state-files": "writing of state files", "part_calibration-disk": "storing of calibrations", part_commands: "recalibration and configuration",
    also: "also: {words}", last_known: "last: {words}",

    rest: "Load at rest.", free: "Load swings freely.", driven: "Trolley or bridge moving.", lowering: "Lowering.", hoisting: "Hoisting.",
    wind: "A gust pushes the load.", known_soon: "It is known after one full swing.",
    back_within: "Usually back within {seconds} s.", known_last: "Known last {ago}.",
    swing_is: "Swing {angle}.", alarm_now: "Swing up to {angle}; limit {limit}.", alarm_coming: "Swing up to {angle} expected; limit {limit}.",
    alarm_unknown: "The limit was exceeded, and the swing is not known now.", lean_alarm: "The rope leans {angle}; limit {limit}.",
    calibration_alarm: "The calibration must be checked: the reading at rest has drifted.", clears: "Clears below {angle}.",
    uncalibrated: "The sensor has no calibration. The angle can be wrong by several degrees.",
    suspended: "Recalibration: the swing is not monitored.",
    suspended_after: "The swing is not monitored, until the service engineer ends the recalibration.",
    disturbed: "Disturbed: the reading does not describe the swing of the load.",
    starting: "Waiting for the first readings.", gateway_gone: "The gateway has stopped, or it is disconnected.",
    no_new_data: "No new data for {seconds} s.", page_silent: "No data from the gateway's page for {seconds} s.",
    page_gone: "No connection to the gateway's page.", page_slow: "Slow connection: the data are {seconds} s old.",
    page_fault: "Fault of the page: {reason}.", not_recording: "Not recording.",

    crane_rest: "at rest", crane_free: "at rest", crane_driven: "moving", crane_lowering: "lowering", crane_hoisting: "hoisting",
    crane_wind: "gust", crane_unknown: "not known", in_seconds: "in {seconds} s", no_swing: "no swing detected",
    was: "not known; was {angle} {ago}", never: "not known", plus_minus: "± {angle} (95 %)",
    warn_at: "warning {angle}", limit_at: "limit {angle}",
    no_reading: "no reading", swing_words: "swing {angle}", along: " along {direction}", lean_words: ", lean {angle}",
    gauge_words: "swing {angle}, warning at {warn}, limit at {trip}", trend_words: "swing of the last ten minutes, {count} values",

    alerts_of: "Alerts since {time}", alert_from: "from", alert_to: "to", alert_what: "alert", alert_largest: "largest", alert_limit: "limit",
    alert_standing: "now", no_alerts: "No alert since {time}.", rule_swing: "Swing", rule_lean: "Lean", rule_calibration: "Calibration",
    level_warn: "warning", level_trip: "limit", level_unknown: "not known",

    acknowledge: "Acknowledge", acknowledge_of: "Acknowledge: {alert}", acknowledged_by: "✓ {time} {name}", alert_acknowledged: "acknowledged",
    not_done: "Not done: {reason}", person_is: "Signed in: {name}", person_none: "Read-only", sign_in: "Sign in", sign_out: "Sign out",
    sign_in_title: "Who acknowledges?", name: "name", cancel: "Cancel", delete: "delete", name_missing: "Enter your name.",
    pin_wrong: "The PIN is wrong.", pin_pause: "Wait {seconds} s before the next attempt.", no_pin: "This gateway has no PIN: nobody can acknowledge here.",
    sign_in_first: "Sign in first.", request_invalid: "The request was not valid.", no_answer: "no answer",

    note_recording: "Not recording. Tell the service engineer.", note_relay: "The relay for horn and lamp does not work. Tell the service engineer.",
    note_battery: "The sensor's battery is low. Charge or change it.", service_faults: ", faults: {count}",

    sound_on: "Sound is on", sound_off: "Turn sound on", silence: "Silence",
    now_ago: "now", seconds_ago: "{count} s ago", minutes_ago: "{count} min ago", hours_ago: "{count} h ago",

    fact_good: "last good value", fact_condition: "condition", fact_period: "period, rope length", fact_calibration: "calibration",
    fact_drift: "drift at rest", fact_device: "device", fact_rate: "sample rate", fact_lost: "lost samples", fact_recording: "recording",
    fact_clock: "clock", fact_faults: "faults", none_yet: "none yet", none: "none", recording_on: "on", recording_off: "off",
    recording_error: "ERROR: {reason}", free_space: ", {size} free", trusted: "trusted", not_trusted: "not trusted",
    clock_synchronised: "clock, synchronised", clock_free_running: "clock, free running", clock_replayed: "clock of the recording",
    mounting_words: "The housing on the hoist rope: z points up along the rope; x points to {x}, y to {y}.",
    up_rope: "z: up along the rope", load: "load",
    rigger: "recalibration", rigger_look: "turn the sensor like this", rigger_taken: "all poses are taken", rigger_ended: "the session has ended",
    rigger_turn: "TURN TO {face}", rigger_turn_picture: "TURN AS SHOWN", rigger_hold: "HOLD STILL", rigger_wait: "WAIT", rigger_stopped: "ENDED",
    rigger_face_up: "{face} up", rigger_as_picture: "as in the picture", rigger_for: "for {seconds} s", rigger_poses: "poses taken: {count} of {wanted}",
    rigger_review: "All poses are taken. Wait for the service engineer.",
    rigger_left: "Recalibration has ended. Put the housing back on the rope and tell the service engineer.",
    rigger_by: "{method}, requested by {by}; the old record stays in force until the commit", rigger_no_contact: "No contact with the gateway.",

    align_title: "the two screws of the housing, heads towards you", align_back: "back", align_screen: "aligning the housing", pitch: "pitch", roll: "roll",
    align_turn: "TURN", align_wait: "WAIT", align_aligned: "ALIGNED", align_pitch_in: "PITCH IN", align_pitch_out: "PITCH OUT", align_roll_in: "ROLL IN",
    align_roll_out: "ROLL OUT", align_then: "Then let it hang still. If the angle grows, turn the other way.", align_no_readings: "no readings",
    align_u: "uncertainty of the vertical by the calibration: ±{angle}° (95 %)", turn_degrees: "{count}° of a turn", turns_one: "{count} turn",
    turns_many: "{count} turns",
  },
  de: {
    swing: "Pendeln", alerts: "Alarme", service: "Service", screens: "Ansichten", status: "Zustand", local_time: "Ortszeit",
    largest_angle: "größter Pendelwinkel der letzten Periode", from_above: "von oben gesehen", last_ten_minutes: "letzte 10 Minuten",
    next_peak: "Spitze", lean: "Schräglage", crane: "Kran", measurement: "Messung", reasons: "Gründe", mounting: "Lage des Gehäuses",
    align: "Gehäuse ausrichten", now: "jetzt",

    word_OK: "OK", word_WARN: "WARNUNG", word_TRIP: "GRENZWERT", word_UNKNOWN: "UNBEKANNT", word_DISTURBED: "GESTÖRT",
    word_UNCALIBRATED: "UNKALIBRIERT", word_SUSPENDED: "AUSGESETZT", word_STALE: "VERALTET", "word_NO DATA": "KEINE DATEN",
    word_MISSING: "FEHLT", word_GONE: "WEG", word_DUPLICATE: "NAME DOPPELT", word_FAULT: "STÖRUNG", "word_BATTERY LOW": "BATTERIE SCHWACH",
    fleet_title: "Krane", fleet_summary: "{acting} von {count} verlangen Eingriff", fleet_no_router: "Keine Verbindung zum Router: die Liste ist alt.",
    fleet_none: "Kein Gateway antwortet.", fleet_never_seen: "nie gesehen",
    fleet_missing: "Erwartet, und nie gesehen.", fleet_duplicate: "Zwei Gateways benutzen gleichzeitig diesen Namen.",
    fleet_fault: "Arbeitet nicht: {parts}.", fleet_no_samples: "Vom Sensor kommen keine Messwerte.", fleet_unknown: "Das Pendeln ist zurzeit unbekannt.",
    gate_complete: "Mehr als ein Zehntel der Messwerte fehlt.", gate_axes_alive: "Eine Achse des Sensors misst genau null.",
    gate_not_clipped: "Ein Messwert hat das Ende des Messbereichs erreicht.", gate_no_impact: "Ein Stoß.", gate_not_shaken: "Die Vibration ist zu stark.",
    gate_norm_hanging: "Die Kraft ist nicht die einer hängenden Last.", gate_explained: "Keine Bewegung von Kran und Last erklärt die Messwerte.",
    gate_no_spin: "Das Gehäuse dreht sich um das Seil.", gate_rate_pendulum: "Das Gehäuse dreht sich schneller, als das Seil pendelt.",
    part_device: "Sensor", part_recording: "Aufzeichnung", part_relay: "Relais", part_bus: "Netzwerk", part_page: "Seite des Krans", part_page_pin: "PIN der Seite",
    part_outbox: "Speicher der Alarme", part_chain: "Kette der Aufzeichnungen", part_signing: "Signatur der Aufzeichnungen", part_identity: "Name des Gateways", part_clock: "Uhr", part_state_files: "Zustandsdateien",
    part_sampler: "Lesen des Sensors", part_processor: "Auswertung", part_recorder: "Schreiben der Aufzeichnung", part_publisher: "Senden der Meldungen", part_alerts: "Senden der Alarme",
    "part_outbox-writer": "Speichern der Alarme", part_rpc: "Fernbefehle", "part_state-files": "Schreiben der Zustandsdateien", "part_calibration-disk": "Speichern der Kalibrierungen", part_commands: "Rekalibrierung und Konfiguration",
    also: "auch: {words}", last_known: "zuletzt: {words}",

    rest: "Last in Ruhe.", free: "Last pendelt frei.", driven: "Katze oder Brücke fährt.", lowering: "Senken.", hoisting: "Heben.",
    wind: "Eine Böe drückt auf die Last.", known_soon: "Bekannt nach einem ganzen Pendeln.",
    back_within: "Meist nach {seconds} s wieder bekannt.", known_last: "Zuletzt bekannt {ago}.",
    swing_is: "Pendeln {angle}.", alarm_now: "Pendeln bis {angle}; Grenze {limit}.", alarm_coming: "Pendeln bis {angle} erwartet; Grenze {limit}.",
    alarm_unknown: "Die Grenze war überschritten, der Pendelwinkel ist jetzt unbekannt.", lean_alarm: "Das Seil steht {angle} schräg; Grenze {limit}.",
    calibration_alarm: "Kalibrierung prüfen: die Anzeige in Ruhe hat sich verschoben.", clears: "Endet unter {angle}.",
    uncalibrated: "Der Sensor ist nicht kalibriert. Der Winkel kann um mehrere Grad falsch sein.",
    suspended: "Rekalibrierung: das Pendeln wird nicht überwacht.",
    suspended_after: "Das Pendeln wird nicht überwacht, bis der Servicetechniker die Rekalibrierung beendet.",
    disturbed: "Gestört: die Anzeige beschreibt das Pendeln der Last nicht.",
    starting: "Warten auf die ersten Messwerte.", gateway_gone: "Das Gateway wurde beendet oder ist nicht verbunden.",
    no_new_data: "Seit {seconds} s keine neuen Daten.", page_silent: "Seit {seconds} s keine Daten von der Seite des Gateways.",
    page_gone: "Keine Verbindung zur Seite des Gateways.", page_slow: "Langsame Verbindung: die Daten sind {seconds} s alt.",
    page_fault: "Fehler der Seite: {reason}.", not_recording: "Keine Aufzeichnung.",

    crane_rest: "in Ruhe", crane_free: "in Ruhe", crane_driven: "fährt", crane_lowering: "senkt", crane_hoisting: "hebt",
    crane_wind: "Böe", crane_unknown: "unbekannt", in_seconds: "in {seconds} s", no_swing: "kein Pendeln erkannt",
    was: "unbekannt; war {angle} {ago}", never: "unbekannt", plus_minus: "± {angle} (95 %)",
    warn_at: "Warnung {angle}", limit_at: "Grenze {angle}",
    no_reading: "keine Anzeige", swing_words: "Pendeln {angle}", along: " entlang {direction}", lean_words: ", Schräglage {angle}",
    gauge_words: "Pendeln {angle}, Warnung bei {warn}, Grenze bei {trip}", trend_words: "Pendeln der letzten zehn Minuten, {count} Werte",

    alerts_of: "Alarme seit {time}", alert_from: "von", alert_to: "bis", alert_what: "Alarm", alert_largest: "größter Wert", alert_limit: "Grenze",
    alert_standing: "jetzt", no_alerts: "Kein Alarm seit {time}.", rule_swing: "Pendeln", rule_lean: "Schräglage", rule_calibration: "Kalibrierung",
    level_warn: "Warnung", level_trip: "Grenzwert", level_unknown: "unbekannt",

    acknowledge: "Quittieren", acknowledge_of: "Quittieren: {alert}", acknowledged_by: "✓ {time} {name}", alert_acknowledged: "quittiert",
    not_done: "Nicht ausgeführt: {reason}", person_is: "Angemeldet: {name}", person_none: "Nur Ansicht", sign_in: "Anmelden", sign_out: "Abmelden",
    sign_in_title: "Wer quittiert?", name: "Name", cancel: "Abbrechen", delete: "löschen", name_missing: "Namen eingeben.",
    pin_wrong: "Die PIN ist falsch.", pin_pause: "Nächster Versuch in {seconds} s.", no_pin: "Dieses Gateway hat keine PIN: hier kann niemand quittieren.",
    sign_in_first: "Erst anmelden.", request_invalid: "Die Anfrage war ungültig.", no_answer: "keine Antwort",

    note_recording: "Keine Aufzeichnung. Servicetechniker verständigen.",
    note_relay: "Das Relais für Hupe und Lampe arbeitet nicht. Servicetechniker verständigen.",
    note_battery: "Die Batterie des Sensors ist schwach. Laden oder wechseln.", service_faults: ", Störungen: {count}",

    sound_on: "Ton ist ein", sound_off: "Ton einschalten", silence: "Ton aus",
    now_ago: "jetzt", seconds_ago: "vor {count} s", minutes_ago: "vor {count} min", hours_ago: "vor {count} h",

    fact_good: "letzter guter Wert", fact_condition: "Zustand", fact_period: "Periode, Seillänge", fact_calibration: "Kalibrierung",
    fact_drift: "Drift in Ruhe", fact_device: "Gerät", fact_rate: "Abtastrate", fact_lost: "verlorene Messwerte", fact_recording: "Aufzeichnung",
    fact_clock: "Uhr", fact_faults: "Störungen", none_yet: "noch keiner", none: "keine", recording_on: "ein", recording_off: "aus",
    recording_error: "FEHLER: {reason}", free_space: ", {size} frei", trusted: "verlässlich", not_trusted: "nicht verlässlich",
    clock_synchronised: "Uhr, synchronisiert", clock_free_running: "Uhr, freilaufend", clock_replayed: "Uhr der Aufzeichnung",
    mounting_words: "Das Gehäuse am Hubseil: z zeigt am Seil nach oben; x zeigt zu {x}, y zu {y}.",
    up_rope: "z: am Seil nach oben", load: "Last",
    rigger: "Rekalibrierung", rigger_look: "Sensor so drehen", rigger_taken: "alle Lagen sind aufgenommen", rigger_ended: "die Sitzung ist beendet",
    rigger_turn: "{face} OBEN", rigger_turn_picture: "WIE IM BILD", rigger_hold: "STILL HALTEN", rigger_wait: "WARTEN", rigger_stopped: "BEENDET",
    rigger_face_up: "{face} oben", rigger_as_picture: "wie im Bild", rigger_for: "{seconds} s lang", rigger_poses: "Lagen: {count} von {wanted}",
    rigger_review: "Alle Lagen sind aufgenommen. Auf den Servicetechniker warten.",
    rigger_left: "Rekalibrierung beendet. Gehäuse wieder ans Seil klemmen und den Servicetechniker verständigen.",
    rigger_by: "{method}, angefordert von {by}; bis zur Übernahme gilt das alte Protokoll", rigger_no_contact: "Keine Verbindung zum Gateway.",

    align_title: "die zwei Schrauben des Gehäuses, Köpfe zum Betrachter", align_back: "zurück", align_screen: "Gehäuse ausrichten", pitch: "Nicken", roll: "Rollen",
    align_turn: "DREHEN", align_wait: "WARTEN", align_aligned: "AUSGERICHTET", align_pitch_in: "NICKEN EIN", align_pitch_out: "NICKEN AUS",
    align_roll_in: "ROLLEN EIN", align_roll_out: "ROLLEN AUS", align_then: "Dann ruhig hängen lassen. Wird der Winkel größer, andersherum drehen.",
    align_no_readings: "keine Messwerte", align_u: "Unsicherheit der Senkrechten durch die Kalibrierung: ±{angle}° (95 %)",
    turn_degrees: "{count}° einer Umdrehung", turns_one: "{count} Umdrehung", turns_many: "{count} Umdrehungen",
  },
};

export const LANGUAGES = Object.keys(TABLES);
let table = TABLES.en;

// Choose the language of the page; an unknown one leaves English.
export function setLanguage(language) {
  const chosen = TABLES[language] ?? TABLES.en;
  if (chosen === table) return;
  table = chosen;
  document.documentElement.lang = language;
  for (const element of document.querySelectorAll("[data-text]")) element.textContent = text(element.dataset.text);
}

// Return the text of a key, with its places filled.
export function text(key, values = {}) {
  const found = table[key];
  if (found === undefined) throw new Error(`no text ${key}`);
  return found.replace(/\{(\w+)\}/g, (_, name) => values[name]);
}

// Return whether a key has a text.
export const hasText = (key) => key in table;

export const tables = () => TABLES;
