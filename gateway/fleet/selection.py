"""Which gateways are judged, which of them are listed, and in which order.

The file that names the gateways of a fleet has one a line, as <site>/<crane>/<sensor>, and the name of its certificate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import inf
from pathlib import Path
from typing import Any, get_args

from gateway.bus.untrusted import GATEWAY_KEY
from gateway.errors import InputError
from gateway.fleet.gateway_status import STATE_LABELS, FleetWord, GatewayStatus
from gateway.messages import Level
from gateway.topics import KEY_PREFIX

URGENCY = {word: number for number, word in enumerate(STATE_LABELS)}
WELL: FleetWord = "OK"
MAX_LINE_WORDS = 2


def parse_states(text: str) -> frozenset[FleetWord]:
    """Return the states of a comma-separated list of their words or labels. Raises `ValueError` for another word."""
    known = {name: word for word, label in STATE_LABELS.items() for name in (_plain(word), _plain(label))}
    names = [_plain(name) for name in text.split(",")]
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"{', '.join(unknown)}: choose from {', '.join(map(_plain, STATE_LABELS.values()))}")
    return frozenset(known[name] for name in names)


def parse_levels(text: str) -> frozenset[Level]:
    """Return the levels of a comma-separated list. Raises `ValueError` for another word."""
    known: dict[str, Level] = {level: level for level in get_args(Level)}
    names = [_plain(name) for name in text.split(",")]
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"{', '.join(unknown)}: choose from {', '.join(known)}")
    return frozenset(known[name] for name in names)


def _plain(name: str) -> str:
    return name.strip().lower().replace(" ", "_")


@dataclass(frozen=True, slots=True)
class NamePatterns:
    """Shell patterns of site, crane and sensor: `*`, `?`, `[abc]`."""

    site: str = "*"
    crane: str = "*"
    sensor: str = "*"

    def matches(self, key: str) -> bool:
        """Return whether a gateway is meant."""
        names = key.split("/")[-3:]
        return all(map(fnmatchcase, names, (self.site, self.crane, self.sensor)))

    @property
    def key_pattern(self) -> str:
        """The narrowest pattern of the bus that includes them: whole names or `*`."""
        names = (self.site, self.crane, self.sensor)
        return KEY_PREFIX + "/".join("*" if set(name) & set("*?[") else name for name in names)


@dataclass(frozen=True, slots=True)
class ListFilter:
    """Which of the judged gateways are listed; an empty set: all."""

    states: frozenset[FleetWord] = frozenset()
    levels: frozenset[Level] = frozenset()

    def select(self, statuses: Sequence[GatewayStatus]) -> list[GatewayStatus]:
        """Return the gateways to list."""
        return [
            status
            for status in statuses
            if (not self.states or status.state in self.states) and (not self.levels or status.level in self.levels)
        ]


def not_well(statuses: Sequence[GatewayStatus], accepted: frozenset[FleetWord]) -> list[GatewayStatus]:
    """Return the gateways that are neither OK nor in an accepted state."""
    return [status for status in statuses if status.state != WELL and status.state not in accepted]


def _largest_first(value: float | None) -> float:
    return inf if value is None else -value


def _smallest_first(value: float | None) -> float:
    return inf if value is None else value


def _urgency(status: GatewayStatus) -> tuple[int, int]:
    """Return the place of a state; behind the alarms that stand come those that nobody can see any more."""
    if status.last_alarm is None:
        return URGENCY[status.state], 0
    return URGENCY["WARN"], 1 + URGENCY[status.last_alarm]


SORTS: dict[str, Callable[[GatewayStatus], Any]] = {
    "state": _urgency,
    "name": lambda status: status.key,
    "swing": lambda status: _largest_first(
        None if status.swing is None else status.swing.phi_max_deg or status.swing.upper95_deg
    ),
    "battery": lambda status: _smallest_first(status.battery_percent),
    "signal": lambda status: _smallest_first(status.signal_dbm),
    "calibration": lambda status: _largest_first(status.calibration_age_days),
    "seen": lambda status: _largest_first(status.seen_s),
    "software": lambda status: status.software or "",
}
"""Orders of the list, by name; gateways that are alike stay in the order of their keys."""


def read_expected(path: Path) -> dict[str, str]:
    """Return the common name of the certificate of each gateway, by key; where the file states none, the name of its crane.

    Raises `InputError` with the line that is wrong.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"{path}: cannot be read ({reason}); name a text file with one gateway a line") from error
    gateways: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        key = words[0] if words[0].startswith(KEY_PREFIX) else KEY_PREFIX + words[0]
        if GATEWAY_KEY.fullmatch(key) is None or len(words) > MAX_LINE_WORDS:
            raise InputError(f"{path}, line {number}: {line.strip()!r} is no gateway; write <site>/<crane>/<sensor>")
        gateways[key] = words[1] if len(words) > 1 else key.split("/")[-2]
    if not gateways:
        raise InputError(f"{path}: names no gateway; write one <site>/<crane>/<sensor> a line")
    return gateways
