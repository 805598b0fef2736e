"""What a person or a monitoring system asked of a fleet, and the answer.

Everything that came over the bus is printed without control characters.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any

from gateway.documents.format import printable_text
from gateway.fleet.gateway_status import STATE_LABELS, FleetWord, GatewayStatus
from gateway.fleet.selection import SORTS, ListFilter, NamePatterns, not_well
from gateway.messages import SCHEMA_VERSION
from gateway.page.channel import place_of
from gateway.units import DAY_S, HOUR_S, MINUTE_S

TABLE_HEADER = ("gateway", "state", "level", "last swing", "battery", "signal", "calibrated", "seen", "software", "why")
MAX_COLUMN_CHARACTERS = 48
"""Basis: a choice; columns stay side by side in a terminal."""
MAX_REASON_CHARACTERS = 160
"""Basis: a choice; a sentence, in the last column."""
UNKNOWN_CELL = "-"
NO_ROUTER = "no connection to the router; the list is old"


def summary_line(statuses: Sequence[GatewayStatus], failing: Sequence[GatewayStatus]) -> str:
    """Return one line: how many gateways there are, and what is wrong."""
    if not statuses:
        return "no gateway"
    counts = Counter(status.state for status in statuses)
    states = ", ".join(f"{counts[word]} {label}" for word, label in STATE_LABELS.items() if counts[word])
    verdict = "all well" if not failing else f"{len(failing)} not well"
    return f"{len(statuses)} {'gateway' if len(statuses) == 1 else 'gateways'}, {verdict}: {states}"


def format_table(statuses: Sequence[GatewayStatus]) -> list[str]:
    """Return the lines of the table, the header first."""
    rows = [TABLE_HEADER, *(_row(status) for status in statuses)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(TABLE_HEADER) - 1)]
    return ["  ".join((*map(str.ljust, row, widths), row[-1])).rstrip() for row in rows]


def _row(status: GatewayStatus) -> tuple[str, ...]:
    return (
        printable_text(status.name, MAX_COLUMN_CHARACTERS),
        status.label,
        status.level,
        _swing(status),
        _battery(status),
        UNKNOWN_CELL if status.signal_dbm is None else f"{status.signal_dbm:.0f} dBm",
        _calibration(status),
        UNKNOWN_CELL if status.seen_s is None else format_age(status.seen_s),
        UNKNOWN_CELL if status.software is None else printable_text(status.software, MAX_COLUMN_CHARACTERS),
        printable_text("; ".join(status.reasons), MAX_REASON_CHARACTERS),
    )


def _swing(status: GatewayStatus) -> str:
    swing = status.swing
    if swing is None:
        return UNKNOWN_CELL
    if swing.phi_max_deg is not None:
        return f"{swing.phi_max_deg:.2f} deg" + ("" if swing.u_deg is None else f" u {swing.u_deg:.2f}")
    return UNKNOWN_CELL if swing.upper95_deg is None else f"< {swing.upper95_deg:.2f} deg"


def _battery(status: GatewayStatus) -> str:
    if status.battery_percent is not None:
        return f"{status.battery_percent:.0f} %"
    return UNKNOWN_CELL if status.battery_v is None else f"{status.battery_v:.2f} V"


def _calibration(status: GatewayStatus) -> str:
    if status.calibration_age_days is not None:
        return f"{max(status.calibration_age_days, 0.0):.0f} d ago"
    return UNKNOWN_CELL if status.calibration is None else status.calibration.replace("_", " ")


def format_age(age_s: float) -> str:
    """Return a time that has passed, in the largest fitting unit."""
    for unit_s, unit in ((DAY_S, "d"), (HOUR_S, "h"), (MINUTE_S, "min")):
        if age_s >= 2 * unit_s:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{age_s:.0f} s"


@dataclass(frozen=True, slots=True)
class FleetQuery:
    """Which gateways are judged and listed."""

    names: NamePatterns = field(default_factory=NamePatterns)
    listed: ListFilter = field(default_factory=ListFilter)
    sort: str = "state"
    accepted: frozenset[FleetWord] = frozenset()
    """States beside OK that are no fault."""


@dataclass(frozen=True, slots=True)
class FleetReport:
    """The gateways that were judged, those that are listed, and those that are not well."""

    time_utc: datetime
    connected: bool
    judged: Sequence[GatewayStatus]
    listed: Sequence[GatewayStatus]
    failing: Sequence[GatewayStatus]
    unexpected: Sequence[GatewayStatus]
    """Gateways that are not on the list of the expected ones; empty without such a list."""
    invalid: int
    """Number of payloads that were no valid message, too large, or under a name that no configuration allows."""

    @property
    def well(self) -> bool:
        """Whether every judged gateway is well, and there is one."""
        return self.connected and bool(self.judged) and not self.failing

    def lines(self) -> list[str]:
        """Return the report as text; the first line is the summary."""
        notes = []
        if self.unexpected:
            notes.append(f"note: not on the list of expected gateways: {', '.join(s.name for s in self.unexpected)}")
        if self.invalid:
            notes.append(f"note: {self.invalid} payloads were dropped, because they are no valid message of a gateway")
        summary = summary_line(self.judged, self.failing)
        table = format_table(self.listed) if self.listed else []
        return [summary if self.connected else f"{NO_ROUTER}: {summary}", *table, *notes]

    def as_json(self) -> dict[str, Any]:
        """Return the report for other programs."""
        return {
            "schema_version": SCHEMA_VERSION,
            "time_utc": self.time_utc.isoformat(),
            "connected": self.connected,
            "well": self.well,
            "counts": dict(Counter(status.state for status in self.judged)),
            "not_well": [status.key for status in self.failing],
            "unexpected": [status.key for status in self.unexpected],
            "invalid": self.invalid,
            "gateways": [{**place_of(status.key), **asdict(status)} for status in self.listed],
        }


def make_report(
    statuses: Sequence[GatewayStatus],
    query: FleetQuery,
    *,
    expected: frozenset[str],
    connected: bool,
    invalid: int,
    time_utc: datetime,
) -> FleetReport:
    """Judge a fleet. The names narrow what is judged; states and levels narrow only what is listed."""
    judged = [status for status in statuses if query.names.matches(status.key)]
    return FleetReport(
        time_utc=time_utc,
        connected=connected,
        judged=judged,
        listed=sorted(query.listed.select(judged), key=SORTS[query.sort]),
        failing=not_well(judged, query.accepted),
        unexpected=[status for status in judged if expected and status.key not in expected],
        invalid=invalid,
    )
