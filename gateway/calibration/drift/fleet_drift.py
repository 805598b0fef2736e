"""Drift of many sensors: age of the calibration, drift, date of the next one, the most urgent first; and drift of their type.

Offset and scale factor of a sensor over its calibrations have the form of Łuczak et al. 2022, Tables 6 to 8 and Figure 7.

How long a calibration of a type of sensor holds is learned from all sensors of it. The error of a reading of 1 g changes from the
first calibration of a sensor to its last one by a random walk and by a rate of its own: its variance is walk² t + rate² t²,
beside that of the two calibrations. Each sensor counts once, so that the sensors are independent of each other; its axes are
taken as independent, too. Both numbers follow from the likelihood of all sensors.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from gateway.calibration.drift.change import (
    DriftChange,
    change_between,
    reading_error_g,
    sensitivity_of,
    tilt_error_rad,
)
from gateway.calibration.drift.forecast import (
    MIN_SPAN_DAYS,
    analyse_drift,
    days_between,
    measuring_records,
)
from gateway.calibration.drift.trend import HORIZON_DAYS
from gateway.calibration.record import CalibrationError, CalibrationRecord, created_at
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.units import HOURS_PER_DAY

DEFAULT_INTERVAL_DAYS = 365.0
"""Longest time between two calibrations, days, whatever the records show. Basis: a choice; cranes are inspected once a year."""

MAX_AHEAD = timedelta(days=1)
"""Time by which a record may be dated ahead. Basis: a choice; clocks of two time zones, and less than any ageing."""
MIN_SENSORS = 3
"""Sensors from which a type is learned. Basis: a choice; nine axes, whose spread is known within a half."""
SHARES = np.concatenate([[0.0], np.geomspace(1e-3, 30.0, 40)])
"""Candidates of each variance at the mean span, relative to the mean square of the changes. Basis: a choice; from what cannot be
seen to more than was ever seen, in steps by a factor of 1.3."""
HALF_CHI_SQUARE = 3.0
"""Log-likelihood below the largest one within which walk and rate are held possible together. Definition: half of the 95 %
quantile of chi-square with two degrees of freedom, since both are asked."""


@dataclass(frozen=True, slots=True)
class DriftRow:
    """One calibration, against the first one; arrays by axis, shape (3,)."""

    created_utc: str
    elapsed_h: float
    """Time since the first calibration, h."""
    offset: Array
    """Offset, raw units."""
    offset_change: Array
    """Relative change of the offset; NaN where the first offset is zero."""
    scale: Array
    """Scale factor, raw units per g."""
    scale_change: Array
    """Relative change of the scale factor."""
    error_g: Array
    """Largest error of a reading within 1 g with the first calibration (eq. 19)."""
    tilt_error_rad: Array
    """Tilt error by it (eq. 20)."""
    offset_change_g: Array
    """Change of the zero-g offset, g."""
    u_offset_change_g: Array
    """Standard uncertainty of `offset_change_g`, g."""
    u_scale_change: Array
    """Standard uncertainty of `scale_change`."""


def drift_table(records: Sequence[CalibrationRecord]) -> tuple[DriftRow, ...]:
    """Return a row for each record of one device that measures offset and scale, oldest first.

    Raises `CalibrationError` without such a record, and for records of different devices or units.
    """
    measuring = measuring_records(records)
    if not measuring:
        raise CalibrationError(f"none of {len(records)} records measured offset and scale")
    return tuple(_row(measuring[0], record) for record in measuring)


def _row(first: CalibrationRecord, record: CalibrationRecord) -> DriftRow:
    offsets = [np.array(one.offset, dtype=np.float64) for one in (first, record)]
    scales = [np.diag(sensitivity_of(one)) for one in (first, record)]
    with np.errstate(divide="ignore", invalid="ignore"):
        offset_change = np.where(offsets[0] == 0, np.nan, offsets[1] / offsets[0] - 1)
    scale_change = scales[1] / scales[0] - 1
    error_g = reading_error_g((offsets[1] - offsets[0]) / scales[0], scale_change)
    change = change_between(first, record)
    return DriftRow(
        created_utc=record.created_utc,
        elapsed_h=(created_at(record) - created_at(first)) / timedelta(hours=1),
        offset=offsets[1],
        offset_change=offset_change,
        scale=scales[1],
        scale_change=scale_change,
        error_g=error_g,
        tilt_error_rad=tilt_error_rad(error_g),
        offset_change_g=change.offset_g,
        u_offset_change_g=change.u_offset_g,
        u_scale_change=change.u_scale,
    )


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
    measuring = measuring_records(records)
    last, made = measuring[-1], created_at(measuring[-1])
    if made > now + MAX_AHEAD:
        raise CalibrationError(
            f"record {last.id} is dated {last.created_utc}, after today: a clock was wrong; correct it and calibrate again"
        )
    days, basis, warnings = _days_to_next(measuring, limit_deg, interval_days)
    next_utc = made + timedelta(days=days)
    drift_deg = u_drift_deg = drift_axis = drift_days = None
    if len(measuring) > 1:
        drift_deg, u_drift_deg, drift_axis = _largest_tilt_error(change_between(measuring[-2], last))
        drift_days = days_between(created_at(measuring[-2]), made)
    return SensorDrift(
        device_id=last.device_id,
        records=len(measuring),
        last_utc=last.created_utc,
        age_days=days_between(made, now),
        drift_deg=drift_deg,
        u_drift_deg=u_drift_deg,
        drift_axis=drift_axis,
        drift_days=drift_days,
        next_utc=next_utc,
        due_days=days_between(now, next_utc),
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
    span_days = days_between(created_at(measuring[0]), created_at(measuring[-1]))
    if span_days < MIN_SPAN_DAYS:
        text = f"{len(measuring)} calibrations within a day show their repeatability and nothing about ageing"
        return interval_days, "interval", (text,)
    report = analyse_drift(measuring, limit_deg)
    if report.within.days < interval_days:
        return report.within.days, "forecast", report.warnings
    return interval_days, "interval", report.warnings


def _largest_tilt_error(change: DriftChange) -> tuple[float, float, str]:
    """Return the tilt error of the axis that has changed most, its standard uncertainty, in degrees, and the axis."""
    axis = int(np.argmax(change.tilt_error_deg))
    u_g = float(np.hypot(change.u_offset_g[axis], change.u_scale[axis]))
    return float(change.tilt_error_deg[axis]), float(np.degrees(u_g)), "xyz"[axis]


@dataclass(frozen=True, slots=True)
class TypeDrift:
    """How long a calibration of a sensor of a type holds: until the 95 % interval of its error reaches the limit, days."""

    sensors: int
    """Those that were learned from."""
    days: float
    """By the most likely numbers."""
    low_days: float
    """Lower end of the 95 % interval: the proposal."""
    high_days: float
    """Upper end; the horizon where no drift is seen."""


def learn_type_drift(sensors: Sequence[SensorDrift], limit_deg: float) -> TypeDrift | None:
    """Return the drift of the type of these sensors; None: too few of them were calibrated twice, a day apart at least."""
    last = [each.table[-1] for each in sensors if each.table[-1].elapsed_h >= MIN_SPAN_DAYS * HOURS_PER_DAY]
    if len(last) < MIN_SENSORS:
        return None
    span_days = np.repeat([each.elapsed_h / HOURS_PER_DAY for each in last], 3)
    change_g = np.concatenate([each.offset_change_g + each.scale_change for each in last])
    variance_g2 = np.concatenate([each.u_offset_change_g**2 + each.u_scale_change**2 for each in last])
    return learn_days(span_days, change_g, variance_g2, len(last), np.sin(np.radians(limit_deg)))


def learn_days(span_days: Array, change_g: Array, variance_g2: Array, sensors: int, limit_g: float) -> TypeDrift:
    """Return the days until a limit from changes with their variances of measurement, arrays of shape (n,)."""
    mean_days, size_g2 = float(np.mean(span_days)), float(np.mean(change_g**2) + np.mean(variance_g2))
    walk_g2, rate_g2 = np.meshgrid(SHARES * size_g2 / mean_days, SHARES * size_g2 / mean_days**2)
    total_g2 = (
        walk_g2[..., np.newaxis] * span_days + rate_g2[..., np.newaxis] * span_days**2 + variance_g2
    )  # (41, 41, n)
    log_likelihood = -0.5 * (np.log(total_g2) + change_g**2 / total_g2).sum(axis=-1)
    days = np.minimum(_days_to(limit_g / NORMAL_975, walk_g2, rate_g2), HORIZON_DAYS)
    possible = days[log_likelihood >= log_likelihood.max() - HALF_CHI_SQUARE]
    best = days.ravel()[int(np.argmax(log_likelihood))]
    return TypeDrift(sensors, float(best), float(possible.min()), float(possible.max()))


def _days_to(deviation_g: float, walk_g2: Array, rate_g2: Array) -> Array:
    """Return when walk² t + rate² t² is the square of a deviation; without either, never."""
    square_g2 = deviation_g**2
    with np.errstate(divide="ignore"):
        return np.asarray(2 * square_g2 / (walk_g2 + np.sqrt(walk_g2**2 + 4 * rate_g2 * square_g2)))
