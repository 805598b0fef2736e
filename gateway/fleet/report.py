"""What a person or a monitoring system asked of a fleet, and the answer."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any

from gateway.fleet.gateway_status import FleetWord, GatewayStatus
from gateway.fleet.selection import SORTS, ListFilter, NamePatterns, not_well
from gateway.fleet.table import format_table, summary_line
from gateway.messages import SCHEMA_VERSION

NO_ROUTER = "no connection to the router; the list is old"


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
            "gateways": [
                {**dict(zip(("site", "crane", "sensor"), status.place, strict=True)), **asdict(status)}
                for status in self.listed
            ],
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
