"""What would have been told otherwise: the alarms of another limit, and the replays of another version or another calibration.

Replays are compared by what an operator would have seen. A result of `replay` has what was told then and what is computed now.
Two versions are compared by their results over the same recordings, and one version with the recordings themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import duckdb
import numpy as np
from numpy.typing import NDArray

from gateway.file_input import decode_json
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.recording.format.segment_summary import RecordedPeak
from gateway.recording.format.summary_builder import RecordedAlert
from gateway.recording.replay.replay_result import ReplayOutcome, paired_alerts
from gateway.stages.alerts import DECISION_FACTOR

TRIED_LIMITS_DEG = tuple(half / 2 for half in range(2, 25))
"""Limits whose cost is stated, 1 to 12 degrees. Basis: a choice; a crane is given one among them."""
SAME_ANGLE_DEG = 0.001
"""Angles that differ by less are the same one. Basis: the last recorded digit; what is computed again is not rounded."""
SAME_TIME_S = 0.1
"""Likewise times without a statement on the swing. Basis: the time between two messages of the alerts."""


@dataclass(frozen=True, slots=True)
class LimitCost:
    """The alarms that another limit would have raised."""

    limit_deg: float
    alarms: int
    false_alarms: int
    """Those in which the best estimate of the angle stayed below the limit."""


def tried_limits(database: duckdb.DuckDBPyConnection) -> tuple[LimitCost, ...]:
    """Return the cost of each limit, by the rule of the alerts for the present angle."""
    share = DECISION_FACTOR / NORMAL_975
    columns = database.execute(
        """
        SELECT number * 4294967296 + minute AS place, angle_deg, angle_deg + ? * (upper_deg - angle_deg) AS compared_deg
        FROM m JOIN (SELECT gateway, row_number() OVER () AS number FROM m GROUP BY gateway) USING (gateway)
        WHERE angle_deg + ? * (upper_deg - angle_deg) >= ? ORDER BY place
        """,
        [share, share, TRIED_LIMITS_DEG[0]],
    ).fetchnumpy()
    place, angle_deg = np.asarray(columns["place"], dtype=np.int64), np.asarray(columns["angle_deg"])
    return limit_costs(place, angle_deg, np.asarray(columns["compared_deg"]), TRIED_LIMITS_DEG)


def limit_costs(
    place: NDArray[np.int64], angle_deg: Array, compared_deg: Array, limits_deg: Sequence[float]
) -> tuple[LimitCost, ...]:
    """Return the alarms of each limit; arrays by minute, shape (n,), where neighbouring minutes have neighbouring places.

    `compared_deg` is what is compared with the limit, `angle_deg` the best estimate.
    """
    costs = []
    for limit_deg in limits_deg:
        is_above = compared_deg >= limit_deg
        minutes, angles_deg = place[is_above], angle_deg[is_above]
        starts = np.flatnonzero(np.diff(minutes, prepend=minutes[:1] - 2) > 1)
        largest_deg = np.maximum.reduceat(angles_deg, starts) if len(starts) else angles_deg
        costs.append(LimitCost(limit_deg, len(starts), int(np.count_nonzero(largest_deg < limit_deg))))
    return tuple(costs)


@dataclass(frozen=True, slots=True)
class OutcomeChange:
    """What an operator would have seen otherwise."""

    missed: tuple[RecordedAlert, ...]
    """Alerts that are told no more."""
    added: tuple[RecordedAlert, ...]
    other_level: tuple[tuple[RecordedAlert, RecordedAlert], ...]
    """Alerts that are a warning in place of a trip, or the other way round: before, after."""
    angle_deg: tuple[float | None, float | None]
    """Largest angle before and after."""
    unknown_s: tuple[float, float]
    """Time without a statement on the swing, before and after."""

    @property
    def angle_change_deg(self) -> float:
        """Size of the change of the largest angle; one that is known on one side alone counts as a whole."""
        before, after = self.angle_deg
        return abs((after or 0.0) - (before or 0.0))

    @property
    def rank(self) -> tuple[float, ...]:
        """The greater, the more an operator would notice: trips missed, alerts missed, added, of another level; angle; time."""
        trips = sum(alert.level == "trip" for alert in self.missed)
        alerts = (trips, len(self.missed), len(self.added), len(self.other_level))
        return (*alerts, self.angle_change_deg, abs(self.unknown_s[1] - self.unknown_s[0]))

    def __bool__(self) -> bool:
        """Return whether anything is seen otherwise."""
        *alerts, angle_change_deg, unknown_change_s = self.rank
        return any(alerts) or angle_change_deg >= SAME_ANGLE_DEG or unknown_change_s >= SAME_TIME_S


def change_between(before: ReplayOutcome, after: ReplayOutcome) -> OutcomeChange:
    """Return what is told otherwise after than before."""
    pairs = list(paired_alerts(before.alerts, after.alerts))
    return OutcomeChange(
        missed=tuple(one for one, other in pairs if one is not None and other is None),
        added=tuple(other for one, other in pairs if one is None and other is not None),
        other_level=tuple(
            (one, other) for one, other in pairs if one is not None and other is not None and one.level != other.level
        ),
        angle_deg=(_degrees(before.largest_angle), _degrees(after.largest_angle)),
        unknown_s=(before.unknown_s, after.unknown_s),
    )


def _degrees(peak: RecordedPeak | None) -> float | None:
    return None if peak is None else peak.phi_max_deg


@dataclass(frozen=True, slots=True)
class ReplayChange:
    """A start of a gateway that would have been told otherwise."""

    gateway: str
    utc: datetime
    """Of its first message."""
    path: str
    """Its first file, within the source of the archive."""
    software: str
    calibration: str | None
    """In place of the recorded ones."""
    is_verified: bool
    change: OutcomeChange


@dataclass(frozen=True, slots=True)
class VersionComparison:
    """The starts of gateways in the order of what an operator would have seen."""

    compared: int
    not_compared: int
    """Replays without a counterpart."""
    changes: tuple[ReplayChange, ...]


@dataclass(frozen=True, slots=True)
class _Content:
    """What is read of a result."""

    recorded: ReplayOutcome
    recomputed: ReplayOutcome


def compare_replays(
    database: duckdb.DuckDBPyConnection, against: str | None, condition: str, values: Sequence[Any]
) -> VersionComparison:
    """Compare replays, chosen by a condition in SQL on the table of results, and rank what has changed.

    `against` is the version whose replays, with the recorded calibration, were before; None: what was recorded.
    """
    rows = database.execute(
        f"""
        WITH replays AS (SELECT * FROM results WHERE kind = 'replay' AND state = 'done'),
        newest AS (
            SELECT * FROM replays WHERE {condition}
            QUALIFY row_number() OVER (PARTITION BY recording, software, calibration ORDER BY recordings DESC) = 1),
        before AS (SELECT subject, content FROM replays WHERE software = ? AND calibration IS NULL)
        SELECT n.site || '/' || n.crane || '/' || n.sensor, n.utc, min(path), n.software, n.calibration,
            n.trust = 'verified', n.content, any_value(before.content)
        FROM newest AS n JOIN recordings AS r ON r.recording = n.recording AND r.status = 'counted'
            LEFT JOIN before ON before.subject = n.subject
        GROUP BY ALL
        """,
        [*values, against or ""],
    ).fetchall()
    compared, changes = 0, []
    for gateway, utc, path, software, calibration, is_verified, content, before in rows:
        outcomes = _outcomes(content, before, against)
        if outcomes is None:
            continue
        compared += 1
        if change := change_between(*outcomes):
            changes.append(ReplayChange(gateway, utc, path, software, calibration, is_verified, change))
    changes.sort(key=lambda each: (*(-number for number in each.change.rank), each.gateway, each.utc))
    return VersionComparison(compared, len(rows) - compared, tuple(changes))


def _outcomes(content: str, before: str | None, against: str | None) -> tuple[ReplayOutcome, ReplayOutcome] | None:
    """Return what was told before and after; None where one of them is not there."""
    try:
        after = decode_json(content, _Content)
        if against is None:
            return after.recorded, after.recomputed
        return None if before is None else (decode_json(before, _Content).recomputed, after.recomputed)
    except ValueError:  # a result of a version that did not write outcomes
        return None
