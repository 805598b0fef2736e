"""The limits of the alerts in an incident, by the configurations in force, and who changed them, by the audit in the log."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from gateway.configuration.model import RecorderSection
from gateway.documents.format import format_limit, human_name, printable_text
from gateway.file_input import parse_json, parse_toml

AUDIT = "audit "
"""Definition: begin of a line of the log that is an entry of an audit."""
MAX_WORDS_CHARACTERS = 260
"""Longest words of a person or of the log in a report. Basis: a choice; two or three lines of the table of events."""
DEFAULT_FSYNC_S = RecorderSection().fsync_s
RIG_SECTIONS = ("rope", "housing", "site", "device")
KEY_CHANGE = re.compile(r"alerts\.(?P<key>\w+): (?P<before>.+) -> (?P<after>.+)")
"""Definition: a change of a key of the alerts in an audit, as `KeyChange` writes it."""
LIMIT_NAMES = {
    "warn_deg": "warning limit of the swing",
    "trip_deg": "trip limit of the swing",
    "clear_deg": "limit below which an alert of the swing clears",
    "lean_trip_deg": "trip limit of the lean",
    "hold_s": "time after which an alert clears",
    "stale_s": "time without a sample after which the reading is stale",
}
UNITS = {"deg": "°", "s": " s", "g": " g"}
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
    def limits(self) -> dict[str, float]:
        """The numbers of the section of the alerts; none where it cannot be read."""
        return self._numbers("alerts")

    @property
    def rig(self) -> tuple[object, ...]:
        """The sections with which the motion is computed."""
        return tuple(self._section(name) for name in RIG_SECTIONS)

    @property
    def fsync_s(self) -> float:
        """The most that a kill costs, in seconds."""
        return self._numbers("recorder").get("fsync_s", DEFAULT_FSYNC_S)

    def _numbers(self, name: str) -> dict[str, float]:
        section = self._section(name)
        return {key: value for key, value in section.items() if _is_number(value)} if isinstance(section, dict) else {}

    def _section(self, name: str) -> object:
        try:
            return parse_toml(self.toml).get(name)
        except ValueError:
            return None


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
class LimitChange:
    """A limit that another configuration has changed."""

    time_s: float
    """From this time on it was in force."""
    key: str
    before: float | None
    after: float | None
    audit: AuditEntry | None
    """Who changed it; None: these recordings do not say."""

    @property
    def words(self) -> str:
        """What was changed: `the trip limit of the swing was changed from 6.0° to 5.0°`."""
        name = LIMIT_NAMES.get(self.key, human_name(self.key))
        before, after = (limit_text(self.key, value) for value in (self.before, self.after))
        return f"the {name} was changed from {before} to {after}"


def limit_text(key: str, value: float | None) -> str:
    """Return a limit with its unit."""
    return "no limit" if value is None else f"{format_limit(value)}{UNITS.get(key.rsplit('_', 1)[-1], '')}"


def parse_audit(time_s: float, line: str) -> AuditEntry | None:
    """Return the entry in a line of the log; None where it has none."""
    if not line.startswith(AUDIT):
        return None
    try:
        content = parse_json(line.removeprefix(AUDIT).encode())
    except ValueError:
        return None
    return AuditEntry(time_s, content) if isinstance(content, dict) else None


def limit_changes(
    configurations: Sequence[ConfigurationInForce], audit: Sequence[AuditEntry]
) -> tuple[LimitChange, ...]:
    """Return the limits that differ from one configuration to the next, in order of time."""
    found = []
    for before, after in pairwise(configurations):
        old, new = before.limits, after.limits
        for key in dict.fromkeys([*old, *new]):
            if old and new and old.get(key) != new.get(key):
                entry = _entry_of(audit, key, new.get(key), before.time_s, after.time_s)
                found.append(LimitChange(after.time_s, key, old.get(key), new.get(key), entry))
    return tuple(found)


def _entry_of(
    audit: Sequence[AuditEntry], key: str, value: float | None, begin_s: float, end_s: float
) -> AuditEntry | None:
    """Return the last entry between two times that applied this value of a key."""
    for entry in reversed(audit):
        changes = entry.content.get("changes")
        if begin_s <= entry.time_s <= end_s and entry.content.get("event") == "applied" and isinstance(changes, list):
            for change in map(KEY_CHANGE.fullmatch, map(str, changes)):
                if change and change["key"] == key and change["after"] == str(value):
                    return entry
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
