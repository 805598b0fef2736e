"""The keys of the configuration that may be read and changed over the bus; all others belong to the gateway's own machine."""

import math
from collections.abc import Sequence
from typing import Any

from gateway.configuration.bus_section import LOCAL_PROTOCOLS
from gateway.configuration.difference import KeyChange
from gateway.configuration.loading import ConfigurationError

Table = dict[str, Any]

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
    "recorder.quota_mb": (1000.0, 1e9),
    "recorder.pre_event_s": (10.0, 86_400.0),
    "recorder.post_event_s": (10.0, 86_400.0),
}
"""Bounds within which values may be changed over the bus. Basis: choices; no crane works at 15 degrees, an operator waits a
minute for the end of an alarm, no hoist rope is shorter or longer, 1000 MB hold the recordings of some five days, and what is
kept around an alert shows how it came about. `recorder.keep_events_days` cannot be changed over the bus: no change there deletes
an event that is younger."""


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
        if section not in REMOTE_KEYS or not isinstance(keys, dict):
            raise ConfigurationError(f"proposal: {section}: can only be changed on the gateway's own machine")
        for key in keys:
            if not _is_listed(REMOTE_KEYS, section, key):
                raise ConfigurationError(f"proposal: {section}.{key}: can only be changed on the gateway's own machine")


def require_bounds(changes: Sequence[KeyChange]) -> None:
    """Refuse changes over the bus that take an operator's protection or the recordings away. Raises `ConfigurationError`."""
    for change in changes:
        low, high = REMOTE_BOUNDS.get(change.key, (-math.inf, math.inf))
        if isinstance(change.after, int | float) and not low <= change.after <= high:
            raise ConfigurationError(
                f"proposal: {change.key}: {change.after:g} is not between {low:g} and {high:g}; beyond them it can only be "
                "set on the gateway's own machine"
            )
        if change.key in ("bus.listen", "bus.connect") and isinstance(change.after, list):
            local = [endpoint for endpoint in change.after if endpoint.partition("/")[0] in LOCAL_PROTOCOLS]
            if local:
                raise ConfigurationError(
                    f"proposal: {change.key}: {local[0]} names a file; it can only be set on the gateway's own machine"
                )


def is_network_key(name: str) -> bool:
    """Return whether a key such as `bus.listen` decides how the gateway is reached."""
    section, _, key = name.partition(".")
    return section in NETWORK_KEYS and key.split(".")[0] in NETWORK_KEYS[section]


def _is_listed(table: dict[str, Any], section: str, key: str) -> bool:
    keys = table[section]
    return keys is None or key in keys
