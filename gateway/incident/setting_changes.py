"""The settings that decide on alerts, by the configurations in force, and who changed them, by the audit in the log."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from gateway.configuration.model import AlertsSection, RecorderSection
from gateway.configuration.proposal import Value, flatten
from gateway.documents.format import format_limit, human_name, printable_text
from gateway.file_input import parse_json, parse_toml

AUDIT = "audit "
"""Definition: begin of a line of the log that is an entry of an audit."""
MAX_WORDS_CHARACTERS = 260
"""Longest words of a person or of the log in a report. Basis: a choice; two or three lines of the table of events."""
MAX_VALUE_CHARACTERS = 80
"""Longest value of a setting in a sentence. Basis: a choice; a line."""
DEFAULT_FSYNC_S = RecorderSection().fsync_s
DEFAULT_HOLD_S = AlertsSection().hold_s
RIG_SECTIONS = ("rope", "housing", "site", "device")
"""With these the motion is computed."""
KEY_CHANGE = re.compile(r"(?P<key>[\w.]+): (?P<before>.+) -> (?P<after>.+)")
"""Definition: a change of a key in an audit, as `KeyChange` writes it."""
SETTING_NAMES = {
    "alerts.warn_deg": "warning limit of the swing",
    "alerts.trip_deg": "trip limit of the swing",
    "alerts.clear_deg": "limit below which an alert of the swing clears",
    "alerts.lean_trip_deg": "trip limit of the lean",
    "alerts.hold_s": "time after which an alert clears",
    "alerts.stale_s": "time without a sample after which the reading is stale",
    "rope.length_m": "length of the rope",
    "housing.position_m": "distance of the housing from the pivot",
    "housing.above_load_m": "distance of the housing from the load",
}
UNITS = {"deg": "°", "s": " s", "g": " g", "m": " m", "hz": " Hz"}
CONFIGURATION_EVENTS = {
    "proposed": "Change of the settings proposed by {by}",
    "applied": "Settings changed by {by}",
    "confirmed": "Change of the settings by {by} confirmed by the gateway",
    "rolled_back": "Change of the settings by {by} rolled back by the gateway",
}


@dataclass(frozen=True, slots=True)
class ConfigurationInForce:
    """A configuration from its first message on."""

    time_s: float
    toml: str

    @property
    def settings(self) -> dict[str, Value]:
        """The values by their dotted keys; none where it cannot be read."""
        try:
            return flatten(parse_toml(self.toml))
        except ValueError:
            return {}

    @property
    def rig(self) -> dict[str, Value]:
        """The settings with which the motion is computed."""
        return {key: value for key, value in self.settings.items() if key.partition(".")[0] in RIG_SECTIONS}

    @property
    def fsync_s(self) -> float:
        """The most that a kill costs, in seconds."""
        return self.number("recorder.fsync_s") or DEFAULT_FSYNC_S

    def number(self, key: str) -> float | None:
        """Return a setting that is a number; None where it is none, or is not given."""
        value = self.settings.get(key)
        return value if isinstance(value, int | float) and not isinstance(value, bool) else None


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """An entry of an audit in the log."""

    time_s: float
    content: Mapping[str, Any]

    @property
    def words(self) -> str:
        """A sentence, with names and reasons as they were given."""
        content = {key: value for key, value in self.content.items() if value}
        by, event = content.get("by", "the gateway"), str(content.get("event", ""))
        if event in CONFIGURATION_EVENTS:
            head = CONFIGURATION_EVENTS[event].format(by=by)
        else:
            refused = ", refused" if content.get("accepted") is False else ""
            head = f"Audit: {human_name(str(content.get('verb', event)))} by {by}{refused}"
        changes = content.get("changes")
        said = [", ".join(map(str, changes))] if isinstance(changes, list) else []
        said += [str(content[key]) for key in ("why", "text") if key in content]
        return f"{head}{': ' if said else ''}{'; '.join(said)}{self.reason}"

    @property
    def reason(self) -> str:
        """The words with a request, or else with the proposal that it applies, as the end of a sentence; or nothing."""
        for key, whose in (("reason", "with the words"), ("proposed_reason", "with the words of the proposal")):
            if text := self.content.get(key):
                return f", {whose}: {printable_text(str(text), MAX_WORDS_CHARACTERS)}"
        return ""


@dataclass(frozen=True, slots=True)
class SettingChange:
    """A setting that another configuration has changed."""

    time_s: float
    """From this time on it was in force."""
    key: str
    before: Value
    after: Value
    audit: AuditEntry | None
    """Who changed it; None: these recordings do not say."""

    @property
    def words(self) -> str:
        """What was changed: `the trip limit of the swing was changed from 6.0° to 5.0°`."""
        name = SETTING_NAMES.get(self.key, f"setting {self.key}")
        before, after = (setting_text(self.key, value) for value in (self.before, self.after))
        return f"the {name} was changed from {before} to {after}"


def setting_text(key: str, value: Value) -> str:
    """Return a value with its unit."""
    if value is None:
        return "none"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return printable_text(str(value), MAX_VALUE_CHARACTERS)
    return f"{format_limit(value)}{UNITS.get(key.rsplit('_', 1)[-1], '')}"


def parse_audit(time_s: float, line: str) -> AuditEntry | None:
    """Return the entry in a line of the log; None where it has none."""
    if not line.startswith(AUDIT):
        return None
    try:
        content = parse_json(line.removeprefix(AUDIT).encode())
    except ValueError:
        return None
    return AuditEntry(time_s, content) if isinstance(content, dict) else None


def setting_changes(
    configurations: Sequence[ConfigurationInForce], audit: Sequence[AuditEntry]
) -> tuple[SettingChange, ...]:
    """Return what differs of alerts and rig from one configuration to the next, in order of time."""
    found = []
    for before, after in pairwise(configurations):
        old, new = before.settings, after.settings
        for key in dict.fromkeys([*old, *new]):
            decides = key.partition(".")[0] in ("alerts", *RIG_SECTIONS)
            if decides and old and new and old.get(key) != new.get(key):
                entry = _entry_of(audit, key, new.get(key), before.time_s, after.time_s)
                found.append(SettingChange(after.time_s, key, old.get(key), new.get(key), entry))
    return tuple(found)


def _entry_of(audit: Sequence[AuditEntry], key: str, value: Value, begin_s: float, end_s: float) -> AuditEntry | None:
    """Return the last entry between two times that applied this value of a key."""
    for entry in reversed(audit):
        changes = entry.content.get("changes")
        if begin_s <= entry.time_s <= end_s and entry.content.get("event") == "applied" and isinstance(changes, list):
            for change in map(KEY_CHANGE.fullmatch, map(str, changes)):
                if change and change["key"] == key and change["after"] == str(value):
                    return entry
    return None
