"""The figures of a report over months, from the tables of an archive.

Everything is made from the minutes, a hundredth of the seconds. An exceedance is a row of neighbouring minutes whose largest
angle reaches the limit.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta

import duckdb
import numpy as np

from gateway.archive.alternatives import LimitCost, VersionComparison, compare_replays, tried_limits
from gateway.archive.query import open_database
from gateway.archive.rows import Trust
from gateway.archive.tables import Archive
from gateway.calibration.drift.fleet_drift import SensorDrift, TypeDrift, fleet_drift, learn_type_drift
from gateway.calibration.store import parse_record
from gateway.errors import InputError
from gateway.file_input import parse_json
from gateway.numerics.array import Array

DRIFT_LIMIT_DEG = 0.5
"""Tilt error at which a sensor is calibrated again. Basis: the default of `plumbline fleet drift`."""
TABLES_READ = ("minutes", "conditions", "health", "calibrations", "recordings", "results")
"""Definition: what the questions below are put to."""
MAX_WORST = 20
"""Worst swings, and replays, that are listed. Basis: a choice; more than anybody looks into."""


@dataclass(frozen=True, slots=True)
class ReportQuestion:
    """What is asked."""

    begin: datetime
    end: datetime
    limit_deg: float
    zone: str = "UTC"
    """Time zone of hours and shifts."""
    shifts: tuple[time, ...] = ()
    """Begin of each shift."""


@dataclass(frozen=True, slots=True)
class GatewayMonth:
    """A gateway over the time of the report."""

    gateway: str
    exceedances: int
    exceeded_minutes: int
    largest_deg: float | None
    recorded_s: float
    known_s: float
    is_verified: bool


@dataclass(frozen=True, slots=True)
class WorstSwing:
    """The largest angle of a gateway in an hour."""

    gateway: str
    utc: datetime
    angle_deg: float
    upper_deg: float
    path: str
    """File with it, within the source of the archive."""
    is_verified: bool


@dataclass(frozen=True, slots=True)
class RestDrift:
    """What the gateway last said of the drift of its sensor, by readings at rest."""

    gateway: str
    device_id: str
    state: str
    norm_error_mg: float | None
    utc: datetime
    is_verified: bool


@dataclass(frozen=True, slots=True)
class UnknownTime:
    """Time in which no statement on the swing was possible, by reason."""

    validity: str
    reason: str
    duration_s: float
    gateways: int
    is_verified: bool


@dataclass(frozen=True, slots=True)
class CalibrationProposal:
    """An earlier date for a sensor, by what others of its type have shown. Nobody applies it but a person."""

    device_id: str
    kind: str
    next_utc: datetime
    """By its own records."""
    proposed_utc: datetime


@dataclass(frozen=True, slots=True)
class ArchiveReport:
    """All figures of a report."""

    question: ReportQuestion
    trust: dict[Trust, int]
    """Recordings that count, by trust."""
    gateways: tuple[GatewayMonth, ...]
    by_hour: Array
    """Minutes above the limit by hour of the day, shape (24,)."""
    by_shift: tuple[tuple[str, int, bool], ...]
    """Name, minutes above the limit, whether all are verified."""
    worst: tuple[WorstSwing, ...]
    sensors: tuple[SensorDrift, ...]
    not_judged: tuple[str, ...]
    """Calibrations without a record that can be judged."""
    at_rest: tuple[RestDrift, ...]
    unknown: tuple[UnknownTime, ...]
    limits: tuple[LimitCost, ...]
    types: dict[str, TypeDrift]
    """Drift by type of sensor."""
    proposals: tuple[CalibrationProposal, ...]
    replays: VersionComparison
    """What was computed again, compared with what was recorded."""


def make_report(archive: Archive, question: ReportQuestion, now: datetime) -> ArchiveReport:
    """Return the report. Raises `InputError` where nothing is there, and `ArchiveError`."""
    with open_database(archive, TABLES_READ) as database:
        _minutes(database, question)
        if not database.execute("SELECT count(*) FROM m").fetchall()[0][0]:
            raise InputError(
                f"{archive.place}: has nothing from {question.begin:%Y-%m-%d} to {question.end:%Y-%m-%d}; "
                "choose another time with --from and --to"
            )
        sensors, not_judged = _sensors(database, question, now)
        types, proposals = _proposals(database, sensors, now)
        return ArchiveReport(
            question,
            _trust(database, question),
            _gateways(database),
            _by_hour(database, question),
            _by_shift(database, question),
            _worst(database, question),
            sensors,
            not_judged,
            _at_rest(database, question),
            _unknown(database, question),
            tried_limits(database),
            types,
            proposals,
            compare_replays(database, None, "utc >= ? AND utc < ?", [question.begin, question.end]),
        )


def _minutes(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> None:
    """Make the table `m` of the minutes; one that two files share is there twice."""
    months = [f"{month:%Y-%m}" for month in _months(question)]
    database.execute(
        """
        CREATE TEMP TABLE m AS
        SELECT site || '/' || crane || '/' || sensor AS gateway, epoch(utc)::BIGINT // 60 AS minute,
            angle_max_deg AS angle_deg, upper_max_deg AS upper_deg, seconds, known_s, trust = 'verified' AS is_verified
        FROM minutes WHERE from_month IN (SELECT unnest(?)) AND utc >= ? AND utc < ?
        """,
        [months, question.begin, question.end],
    )
    database.execute(
        """
        CREATE TEMP TABLE above AS
        SELECT gateway, minute, bool_and(is_verified) AS is_verified FROM m WHERE angle_deg >= ? GROUP BY ALL
        """,
        [question.limit_deg],
    )


def _months(question: ReportQuestion) -> list[datetime]:
    """Return the months of recordings that may have minutes of the report, from the one before its begin on."""
    first = question.begin.year * 12 + question.begin.month - 2
    last = question.end.year * 12 + question.end.month - 1
    return [datetime(number // 12, number % 12 + 1, 1, tzinfo=UTC) for number in range(first, last + 1)]


def _trust(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> dict[Trust, int]:
    rows = database.execute(
        "SELECT trust, count(DISTINCT recording) FROM recordings WHERE status = 'counted' AND utc < ? AND end_utc >= ? "
        "GROUP BY trust ORDER BY trust",
        [question.end, question.begin],
    )
    return dict(rows.fetchall())


def _gateways(database: duckdb.DuckDBPyConnection) -> tuple[GatewayMonth, ...]:
    rows = database.execute(
        """
        WITH neighbours AS (
            SELECT gateway, minute - lag(minute) OVER (PARTITION BY gateway ORDER BY minute) AS distance FROM above),
        exceeded AS (
            SELECT gateway, count(*) FILTER (coalesce(distance > 1, true)) AS exceedances, count(*) AS minutes
            FROM neighbours GROUP BY gateway),
        whole AS (
            SELECT gateway, max(angle_deg) AS largest_deg, sum(seconds) AS recorded_s, sum(known_s) AS known_s,
                bool_and(is_verified) AS is_verified
            FROM m GROUP BY gateway)
        SELECT gateway, coalesce(exceedances, 0), coalesce(minutes, 0), largest_deg, recorded_s::DOUBLE, known_s, is_verified
        FROM whole LEFT JOIN exceeded USING (gateway) ORDER BY 3 DESC, 4 DESC NULLS LAST, 1
        """
    )
    return tuple(GatewayMonth(*row) for row in rows.fetchall())


def _by_hour(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> Array:
    rows = database.execute(
        "SELECT hour(timezone(?, to_timestamp(minute * 60))), count(*) FROM above GROUP BY ALL", [question.zone]
    )
    by_hour = np.zeros(24)
    for hour, count in rows.fetchall():
        by_hour[hour] = count
    return by_hour


def _by_shift(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> tuple[tuple[str, int, bool], ...]:
    """Return each shift with its minutes above the limit; what is before the first one of a day belongs to the last."""
    begins = sorted(question.shifts)
    names = [f"{begin:%H:%M} to {end:%H:%M}" for begin, end in zip(begins, [*begins[1:], *begins[:1]], strict=True)]
    rows = database.execute(
        "SELECT timezone(?, to_timestamp(minute * 60))::TIME, is_verified FROM above", [question.zone]
    ).fetchall()
    counts, verified = [0] * len(begins), [True] * len(begins)
    for moment, is_verified in rows if begins else ():
        place = sum(begin <= moment for begin in begins) - 1
        counts[place] += 1
        verified[place] &= is_verified
    return tuple(zip(names, counts, verified, strict=True))


def _worst(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> tuple[WorstSwing, ...]:
    """Return the largest angles, one of each gateway and hour, with the files that have them."""
    hours = database.execute(
        "SELECT max(angle_deg) FROM m WHERE angle_deg IS NOT NULL GROUP BY gateway, minute // 60 ORDER BY 1 DESC LIMIT ?",
        [MAX_WORST],
    ).fetchall()
    if not hours:
        return ()
    rows = database.execute(
        """
        WITH worst AS (
            SELECT site || '/' || crane || '/' || sensor AS gateway, largest_utc, angle_max_deg AS angle_deg, upper_max_deg,
                recording, trust = 'verified' AS is_verified
            FROM minutes WHERE angle_max_deg >= ? AND utc >= ? AND utc < ?
            QUALIFY row_number() OVER (
                PARTITION BY site, crane, sensor, epoch(utc)::BIGINT // 3600 ORDER BY angle_max_deg DESC, utc) = 1)
        SELECT gateway, largest_utc, angle_deg, upper_max_deg, min(path), is_verified
        FROM worst JOIN recordings USING (recording) GROUP BY ALL ORDER BY 3 DESC, 1, 2 LIMIT ?
        """,
        [hours[-1][0], question.begin, question.end, MAX_WORST],
    )
    return tuple(WorstSwing(*row) for row in rows.fetchall())


def _sensors(
    database: duckdb.DuckDBPyConnection, question: ReportQuestion, now: datetime
) -> tuple[tuple[SensorDrift, ...], tuple[str, ...]]:
    """Return age and drift of each sensor that was calibrated before the end of the report, by its records."""
    rows = database.execute(
        "SELECT DISTINCT device_id, record FROM calibrations WHERE utc < ? ORDER BY ALL", [question.end]
    )
    records, problems = {}, []
    for device_id, text in rows.fetchall():
        if not text:
            problems.append(f"{device_id}: has no calibration record")
            continue
        try:
            record = parse_record(parse_json(text), device_id, f"record of {device_id}")
        except (InputError, ValueError) as error:
            problems.append(str(error))
        else:
            records[record.sha256] = record
    if not records:
        return (), tuple(problems)
    sensors, failures = fleet_drift(list(records.values()), now, limit_deg=DRIFT_LIMIT_DEG)
    return sensors, (*problems, *failures)


def _proposals(
    database: duckdb.DuckDBPyConnection, sensors: Sequence[SensorDrift], now: datetime
) -> tuple[dict[str, TypeDrift], tuple[CalibrationProposal, ...]]:
    """Learn the drift of each type, and return the sensors for which an earlier date than their own follows from it."""
    kinds = dict(
        database.execute(
            "SELECT device_id, min(device_kind) FROM health WHERE device_id IS NOT NULL GROUP BY ALL"
        ).fetchall()
    )
    by_kind: dict[str, list[SensorDrift]] = defaultdict(list)
    for sensor in sensors:
        if sensor.device_id in kinds:
            by_kind[kinds[sensor.device_id]].append(sensor)
    learned = {kind: learn_type_drift(own, DRIFT_LIMIT_DEG) for kind, own in sorted(by_kind.items())}
    types = {kind: found for kind, found in learned.items() if found is not None}
    proposals = [
        CalibrationProposal(sensor.device_id, kind, sensor.next_utc, now + timedelta(found.low_days - sensor.age_days))
        for kind, found in types.items()
        for sensor in by_kind[kind]
    ]
    earlier = [each for each in proposals if each.proposed_utc < each.next_utc]
    return types, tuple(sorted(earlier, key=lambda each: (each.proposed_utc, each.device_id)))


def _at_rest(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> tuple[RestDrift, ...]:
    rows = database.execute(
        """
        WITH newest AS (
            SELECT site || '/' || crane || '/' || sensor AS gateway, device_id,
                max({'utc': utc, 'state': drift_state, 'error': drift_norm_error_mg, 'is_verified': trust = 'verified'}) AS last
            FROM health WHERE drift_state IS NOT NULL AND utc >= ? AND utc < ? GROUP BY ALL)
        SELECT gateway, device_id, last.state, last.error, last.utc, last.is_verified
        FROM newest ORDER BY abs(last.error) DESC NULLS LAST, 1
        """,
        [question.begin, question.end],
    )
    return tuple(RestDrift(*row) for row in rows.fetchall())


def _unknown(database: duckdb.DuckDBPyConnection, question: ReportQuestion) -> tuple[UnknownTime, ...]:
    rows = database.execute(
        """
        SELECT coalesce(validity, 'not stated'), coalesce(reason, 'no reason stated'), sum(duration_s),
            count(DISTINCT site || '/' || crane || '/' || sensor), bool_and(trust = 'verified')
        FROM conditions WHERE utc >= ? AND utc < ?
            AND coalesce(validity <> 'valid', verdict IN ('unknown', 'disturbed'))
        GROUP BY ALL ORDER BY 3 DESC, 1, 2 LIMIT 30
        """,
        [question.begin, question.end],
    )
    return tuple(UnknownTime(*row) for row in rows.fetchall())
