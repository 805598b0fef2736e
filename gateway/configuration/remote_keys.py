"""The keys of the configuration that may be read and changed over the bus; all others belong to the gateway's own machine."""

from typing import Any

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


def is_network_key(name: str) -> bool:
    """Return whether a key such as `bus.listen` decides how the gateway is reached."""
    section, _, key = name.partition(".")
    return section in NETWORK_KEYS and key.split(".")[0] in NETWORK_KEYS[section]


def _is_listed(table: dict[str, Any], section: str, key: str) -> bool:
    keys = table[section]
    return keys is None or key in keys
