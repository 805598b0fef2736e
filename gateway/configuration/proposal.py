"""A change of the configuration over the bus: the keys that may be changed, its validation, and the file that follows."""

import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict

from gateway.configuration.bus_section import LOCAL_PROTOCOLS
from gateway.configuration.loading import ConfigurationError, load_text, suggest
from gateway.configuration.model import Configuration

Table = dict[str, Any]
Value = str | int | float | bool | list[str] | None

REMOTE_KEYS = {
    "gateway": ("site", "crane", "sensor"),
    "device": ("kind", "bus", "address", "sensor", "odr_hz", "range_g", "axes_map", "block_samples", "serial", "baud"),
    "rope": None,
    "housing": None,
    "site": None,
    "filter": None,
    "alerts": None,
    "recorder": ("segment_s", "quota_mb", "fsync_s", "pre_event_s", "post_event_s"),
    "bus": ("mode", "connect", "listen"),
    "page": ("enabled", "listen", "language", "directions"),
}
"""Keys of each section; None: all of them. A key or section that is not listed names files, commands or secrets, or is new."""
NETWORK_KEYS = {
    "gateway": ("site", "crane", "sensor"),
    "bus": ("mode", "connect", "listen"),
    "page": ("listen", "enabled"),
}
"""Keys by which a gateway is reached: a wrong one cuts it off, and a listener may expose it. They need an explicit permission."""
REMOTE_BOUNDS = {
    "alerts.trip_deg": (0.0, 15.0),
    "alerts.lean_trip_deg": (0.0, 15.0),
    "alerts.hold_s": (0.5, 60.0),
    "alerts.stale_s": (0.2, 5.0),
    "rope.length_m": (0.3, 500.0),
    "filter.cutoff_hz": (0.1, 100.0),
    "recorder.quota_mb": (1000.0, 1e9),
    "recorder.pre_event_s": (10.0, 86_400.0),
    "recorder.post_event_s": (10.0, 86_400.0),
}
"""Bounds within which values may be changed over the bus. Basis: choices; no crane works at 15 degrees, an operator waits a
minute for the end of an alarm, no hoist rope is shorter or longer, a filter of 0.1 Hz shows the lean of a load at rest within
seconds, 1000 MB hold the recordings of some five days, and what is kept around an alert shows how it came about.
`recorder.keep_events_days` cannot be changed over the bus: no change there deletes an event that is younger."""


class KeyChange(BaseModel):
    """A key whose value differs; None: not given."""

    model_config = ConfigDict(frozen=True)

    key: str
    before: Value
    after: Value

    def __str__(self) -> str:
        return f"{self.key}: {_shown(self.before)} -> {_shown(self.after)}"


def difference(before: Configuration, after: Configuration) -> list[KeyChange]:
    """Return the keys with different values, with their defaults where they are not given, in the order of the sections."""
    old, new = flatten(before.model_dump(mode="json")), flatten(after.model_dump(mode="json"))
    keys = list(dict.fromkeys([*old, *new]))
    return [KeyChange(key=key, before=old.get(key), after=new.get(key)) for key in keys if old.get(key) != new.get(key)]


def flatten(table: dict[str, Any], prefix: str = "") -> dict[str, Value]:
    """Return the values of nested tables by their dotted keys."""
    flat: dict[str, Value] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat


def _shown(value: Value) -> str:
    return "not given" if value is None else str(value)


@dataclass(frozen=True, slots=True)
class CheckedProposal:
    """A proposal that the gateway accepts."""

    text: str
    """The whole new file."""
    changes: list[KeyChange]


def text_hash(text: str) -> str:
    """Return the SHA-256 of a file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def check_proposal(
    text: str, proposal: Table, *, allow_network: bool, environment: Mapping[str, str] = os.environ
) -> CheckedProposal:
    """Return the file and the changes that follow from a proposal.

    A section of the proposal replaces the keys of that section which may be changed over the bus; other sections stay, and so do
    the comments of the file. Raises `ConfigurationError` where the result is not valid, the same, or not permitted.
    """
    require_remote(proposal)
    where = "proposal"
    new_text = _merge(text, proposal)
    load_text(new_text, where, environment)
    # Compared without the environment, which would hide a change of a key that it overrides.
    changes = difference(load_text(text, "the present configuration", {}), load_text(new_text, where, {}))
    if not changes:
        raise ConfigurationError(f"{where}: changes nothing")
    require_bounds(changes)
    network = [change.key for change in changes if is_network_key(change.key)]
    if network and not allow_network:
        raise ConfigurationError(
            f"{where}: {', '.join(network)}: a wrong value cuts the gateway off; allow it with --allow-network"
        )
    return CheckedProposal(new_text, changes)


def _merge(text: str, proposal: Table) -> str:
    """Return the text of the file with the sections of a proposal."""
    import tomlkit  # noqa: PLC0415 loaded with the first proposal: the daemon starts without it

    document = tomlkit.parse(text)
    for name, keys in proposal.items():
        if name not in document:
            document[name] = tomlkit.table()
        section: Any = document[name]
        listed = REMOTE_KEYS[name]
        for key in [key for key in section if (listed is None or key in listed) and key not in keys]:
            del section[key]
        for key, value in keys.items():
            if key not in section or section[key] != value:
                section[key] = value
    return tomlkit.dumps(document)


def visible_part(table: Table) -> Table:
    """Return the part of a configuration's table that may be read over the bus."""
    visible: Table = {}
    for section, keys in table.items():
        if section in REMOTE_KEYS and isinstance(keys, dict):
            visible[section] = {key: value for key, value in keys.items() if _is_listed(REMOTE_KEYS, section, key)}
    return visible


def require_remote(table: Table) -> None:
    """Refuse a proposal with a key that only the gateway's own machine may change. Raises `ConfigurationError`."""
    for section, keys in table.items():
        if section not in Configuration.model_fields:
            raise ConfigurationError(f"proposal: {section}: unknown key{suggest(section, Configuration.model_fields)}")
        if section not in REMOTE_KEYS or not isinstance(keys, dict):
            raise ConfigurationError(f"proposal: {section}: can only be changed on the gateway's own machine")
        for key in keys:
            if not _is_listed(REMOTE_KEYS, section, key):
                raise ConfigurationError(f"proposal: {section}.{key}: can only be changed on the gateway's own machine")


def require_bounds(changes: Sequence[KeyChange]) -> None:
    """Refuse changes over the bus that take an operator's protection or the recordings away. Raises `ConfigurationError`."""
    problems = []
    for change in changes:
        low, high = REMOTE_BOUNDS.get(change.key, (-math.inf, math.inf))
        if isinstance(change.after, int | float) and not low <= change.after <= high:
            problems.append(
                f"{change.key}: {change.after:g} is not between {low:g} and {high:g}; beyond them it can only be set on the "
                "gateway's own machine"
            )
        if change.key in ("bus.listen", "bus.connect") and isinstance(change.after, list):
            local = [endpoint for endpoint in change.after if endpoint.partition("/")[0] in LOCAL_PROTOCOLS]
            if local:
                problems.append(
                    f"{change.key}: {local[0]} names a file; it can only be set on the gateway's own machine"
                )
    if problems:
        raise ConfigurationError(f"proposal: {'; '.join(problems)}")


def is_network_key(name: str) -> bool:
    """Return whether a key such as `bus.listen` decides how the gateway is reached."""
    section, _, key = name.partition(".")
    return section in NETWORK_KEYS and key.split(".")[0] in NETWORK_KEYS[section]


def _is_listed(table: dict[str, Any], section: str, key: str) -> bool:
    keys = table[section]
    return keys is None or key in keys
