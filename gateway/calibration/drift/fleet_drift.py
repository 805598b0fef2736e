"""Drift of many sensors: age of the calibration, drift, date of the next one, the most urgent first."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from gateway.calibration.drift.change import change_between
from gateway.calibration.drift.drift_table import DriftRow, drift_table
from gateway.calibration.drift.forecast import (
    MEASURING_METHODS,
    MIN_SPAN_DAYS,
    SECONDS_PER_DAY,
    analyse_drift,
    created_at,
)
from gateway.calibration.record import CalibrationError, CalibrationRecord

DEFAULT_INTERVAL_DAYS = 365.0
"""Longest time between two calibrations, days, whatever the records show. Basis: a choice; cranes are inspected once a year."""


@dataclass(frozen=True, slots=True)
class SensorDrift:
    """State of one sensor."""

    device_id: str
    records: int
    """Number of records that measure offset and scale."""
    last_utc: str
    age_days: float
    """Time since the last calibration, days."""
    drift_deg: float | None
    """Tilt error since the calibration before (Łuczak et al. 2022, eq. 19, 20), largest axis, degrees; None: a single one."""
    u_drift_deg: float | None
    """Standard uncertainty of `drift_deg`."""
    drift_axis: str | None
    drift_days: float | None
    """Time in which that drift occurred, days."""
    next_utc: datetime
    """Date of the next calibration."""
    due_days: float
    """Days until then; negative when it is overdue."""
    basis: str
    """What the date follows from: `forecast` of the records, or the longest `interval`."""
    table: tuple[DriftRow, ...]
    warnings: tuple[str, ...]

    @property
    def is_overdue(self) -> bool:
        """Whether the next calibration should have been made."""
        return self.due_days < 0


def fleet_drift(
    records: Sequence[CalibrationRecord],
    now: datetime,
    *,
    limit_deg: float,
    interval_days: float = DEFAULT_INTERVAL_DAYS,
) -> tuple[tuple[SensorDrift, ...], tuple[str, ...]]:
    """Return the state of every device, the most urgent first, and a text for each device that cannot be judged.

    The next calibration is due when the upper end of the predicted tilt error reaches `limit_deg`, and after `interval_days` at
    the latest.
    """
    found, failures = [], []
    for device_id in sorted({record.device_id for record in records}):
        own = [record for record in records if record.device_id == device_id]
        try:
            found.append(_judge_sensor(own, now, limit_deg, interval_days))
        except CalibrationError as error:
            failures.append(f"{device_id}: {error}")
    return tuple(sorted(found, key=lambda sensor: (sensor.due_days, sensor.device_id))), tuple(failures)


def _judge_sensor(
    records: Sequence[CalibrationRecord], now: datetime, limit_deg: float, interval_days: float
) -> SensorDrift:
    table = drift_table(records)
    measuring = sorted((record for record in records if record.method in MEASURING_METHODS), key=created_at)
    last = measuring[-1]
    days, basis, warnings = _days_to_next(measuring, limit_deg, interval_days)
    next_utc = created_at(last) + timedelta(days=days)
    drift = _last_drift(measuring)
    return SensorDrift(
        device_id=last.device_id,
        records=len(measuring),
        last_utc=last.created_utc,
        age_days=(now - created_at(last)).total_seconds() / SECONDS_PER_DAY,
        drift_deg=None if drift is None else drift[0],
        u_drift_deg=None if drift is None else drift[1],
        drift_axis=None if drift is None else drift[2],
        drift_days=None
        if drift is None
        else (created_at(last) - created_at(measuring[-2])).total_seconds() / SECONDS_PER_DAY,
        next_utc=next_utc,
        due_days=(next_utc - now).total_seconds() / SECONDS_PER_DAY,
        basis=basis,
        table=table,
        warnings=warnings,
    )


def _days_to_next(
    measuring: Sequence[CalibrationRecord], limit_deg: float, interval_days: float
) -> tuple[float, str, tuple[str, ...]]:
    """Return the days from the last record to the next calibration, what they follow from, and warnings."""
    if len(measuring) < 2:
        return interval_days, "interval", ("a single calibration: its drift is not known",)
    span_days = (created_at(measuring[-1]) - created_at(measuring[0])).total_seconds() / SECONDS_PER_DAY
    if span_days < MIN_SPAN_DAYS:
        text = f"{len(measuring)} calibrations within a day show their repeatability and nothing about ageing"
        return interval_days, "interval", (text,)
    report = analyse_drift(measuring, limit_deg)
    if report.within.days < interval_days:
        return report.within.days, "forecast", report.warnings
    return interval_days, "interval", report.warnings


def _last_drift(measuring: Sequence[CalibrationRecord]) -> tuple[float, float, str] | None:
    """Return tilt error, its standard uncertainty in degrees and the axis of the change since the record before."""
    if len(measuring) < 2:
        return None
    change = change_between(measuring[-2], measuring[-1])
    axis = int(np.argmax(change.tilt_error_deg))
    u_g = float(np.hypot(change.u_offset_g[axis], change.u_scale[axis]))
    return float(change.tilt_error_deg[axis]), float(np.degrees(u_g)), "xyz"[axis]
