"""Drift over successive records of one device: trends of offset and scale by axis, and the days until the next calibration."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from gateway.calibration.drift.change import change_between, reading_error_g
from gateway.calibration.drift.trend import FORECAST_STEPS, HORIZON_DAYS, Trend, fit_measurements
from gateway.calibration.record import ROTATION, THERMAL, CalibrationError, CalibrationRecord, PoseMethod, created_at
from gateway.numerics.array import Array

DEFAULT_LIMIT_DEG = 0.5
"""Tilt error, degrees, at which a sensor is calibrated again: 48 hours caused 0.43 degrees (Łuczak et al. 2022, eq. 20)."""
FIRST_STEP_DAYS = 1 / 24
"""First step of a forecast, days. Definition: an hour; no date of a calibration needs a finer one."""
MEASURING_METHODS = frozenset({*(method.value for method in PoseMethod), ROTATION, THERMAL})
"""Methods that measure offset and scale; the records of other methods copy those of their parent."""
SIMILAR_TEMPERATURE_C = 5.0
"""Largest difference of the records' mean temperatures, °C, at which thermal drift is not mentioned. Basis: a choice; offsets
change by 2.5 mg at 0.5 mg/°C, and rooms differ by some degrees."""
MIN_SPAN_DAYS = 1.0
"""Records within a day of each other show the repeatability of the calibration and nothing about ageing. Basis: a choice; ageing
takes weeks."""
SECONDS_PER_DAY = 86_400.0


@dataclass(frozen=True, slots=True)
class AxisDrift:
    """Trends of one sensor axis relative to the first record."""

    axis: str
    offset_g: Trend
    """Trend of the zero-g offset, g and g/day."""
    scale: Trend
    """Trend of the scale factor, relative and 1/day."""
    last_offset_g: float
    """Change of the offset up to the last record, g."""
    last_scale: float
    """Relative change of the scale factor up to the last record."""

    @property
    def shows_trend(self) -> bool:
        """Whether the interval of a rate excludes zero."""
        return any(trend.rate_low > 0 or trend.rate_high < 0 for trend in (self.offset_g, self.scale))

    def error_g(self, day: Array) -> tuple[Array, Array]:
        """Return the expected error of the last record on later days, and the upper end of its 95 % interval, each (m,).

        Offset and scale are measured independently: their expected errors add (Łuczak et al. 2022, eq. 19), their intervals add
        in squares.
        """
        offset_g, half_offset_g = self.offset_g.predict(day)
        scale, half_scale = self.scale.predict(day)
        expected = reading_error_g(offset_g - self.last_offset_g, scale - self.last_scale)
        return expected, expected + np.hypot(half_offset_g, half_scale)


@dataclass(frozen=True, slots=True)
class RecalibrateWithin:
    """Days after the last record until its error reaches the limit."""

    days: float
    """Days until the upper end of the predicted error reaches the limit."""
    expected_days: float | None
    """Days until the expected error reaches the limit; None: beyond the horizon."""
    axis: str
    """Axis that reaches the limit first."""
    limit_deg: float
    beyond_horizon: bool
    """Whether the upper end stays below the limit up to the horizon; `days` is the horizon then."""


@dataclass(frozen=True, slots=True)
class DriftReport:
    """Drift over successive records."""

    device_id: str
    records: int
    """Number of records that measure offset and scale."""
    first_utc: str
    last_utc: str
    span_days: float
    axes: tuple[AxisDrift, AxisDrift, AxisDrift]
    within: RecalibrateWithin
    warnings: tuple[str, ...]


def analyse_drift(
    records: Sequence[CalibrationRecord],
    limit_deg: float = DEFAULT_LIMIT_DEG,
) -> DriftReport:
    """Return the trends over the records of one device, in any order; records that do not measure offset and scale are skipped.

    Raises `CalibrationError` for fewer than two measuring records, two devices or units, records without uncertainties, or equal
    times.
    """
    measuring = measuring_records(records)
    if len(measuring) < 2:
        raise CalibrationError(
            f"a drift needs two calibrations at least; of {len(records)} records, {len(measuring)} measured offset and scale"
        )
    changes = [change_between(measuring[0], record, is_reference=True) for record in measuring]
    first = created_at(measuring[0])
    day = np.array([days_between(first, created_at(record)) for record in measuring])
    x, y, z = (
        AxisDrift(
            axis=name,
            offset_g=fit_measurements(
                day,
                np.array([change.offset_g[axis] for change in changes]),
                np.array([change.u_offset_g[axis] for change in changes]),
            ),
            scale=fit_measurements(
                day,
                np.array([change.scale[axis] for change in changes]),
                np.array([change.u_scale[axis] for change in changes]),
            ),
            last_offset_g=float(changes[-1].offset_g[axis]),
            last_scale=float(changes[-1].scale[axis]),
        )
        for axis, name in enumerate("xyz")
    )
    return DriftReport(
        device_id=measuring[0].device_id,
        records=len(measuring),
        first_utc=measuring[0].created_utc,
        last_utc=measuring[-1].created_utc,
        span_days=float(day[-1]),
        axes=(x, y, z),
        within=_recalibrate_within((x, y, z), float(day[-1]), limit_deg),
        warnings=_warnings(records, measuring, (x, y, z)),
    )


def measuring_records(records: Sequence[CalibrationRecord]) -> list[CalibrationRecord]:
    """Return the records that measure offset and scale, oldest first."""
    return sorted((record for record in records if record.method in MEASURING_METHODS), key=created_at)


def days_between(earlier: datetime, later: datetime) -> float:
    """Return the days from one time to another."""
    return (later - earlier).total_seconds() / SECONDS_PER_DAY


def _recalibrate_within(axes: tuple[AxisDrift, ...], last_day: float, limit_deg: float) -> RecalibrateWithin:
    ahead_days = np.concatenate([[0.0], np.geomspace(FIRST_STEP_DAYS, HORIZON_DAYS, FORECAST_STEPS)])
    limit_g = np.sin(np.radians(limit_deg))
    reached = [(*_days_below_limit(axis, last_day, ahead_days, limit_g), axis.axis) for axis in axes]
    days, _, axis = min(reached, key=lambda entry: (entry[0], np.inf if entry[1] is None else entry[1]))
    expected = [entry[1] for entry in reached if entry[1] is not None]
    return RecalibrateWithin(
        days=float(min(days, HORIZON_DAYS)),
        expected_days=min(expected, default=None),
        axis=axis,
        limit_deg=limit_deg,
        beyond_horizon=bool(np.isinf(days)),
    )


def _days_below_limit(
    axis: AxisDrift, last_day: float, ahead_days: Array, limit_g: float
) -> tuple[float, float | None]:
    """Return the last steps at which the upper end, and the expected error, are still below the limit."""
    expected_g, upper_g = axis.error_g(last_day + ahead_days)
    expected, upper = expected_g >= limit_g, upper_g >= limit_g
    return (
        float(ahead_days[max(int(np.argmax(upper)) - 1, 0)]) if upper.any() else np.inf,
        float(ahead_days[max(int(np.argmax(expected)) - 1, 0)]) if expected.any() else None,
    )


def _warnings(
    records: Sequence[CalibrationRecord], measuring: Sequence[CalibrationRecord], axes: tuple[AxisDrift, ...]
) -> tuple[str, ...]:
    texts = []
    if skipped := len(records) - len(measuring):
        texts.append(f"skipped: {skipped} of {len(records)} records, which do not measure offset and scale")
    if len(measuring) == 2:
        texts.append("two calibrations: a straight line between them cannot be checked")
    if not any(axis.shows_trend for axis in axes):
        texts.append("no axis shows a trend: the days follow from what these records cannot exclude")
    if rejected := [axis.axis for axis in axes if axis.offset_g.is_rejected or axis.scale.is_rejected]:
        texts.append(
            f"axis {', '.join(rejected)}: the values scatter about a line more than their uncertainties allow; no steady trend"
        )
    means = [record.temperature_c["mean"] for record in measuring if record.temperature_c]
    if len(means) < len(measuring):
        texts.append("a temperature is not known: thermal drift and ageing cannot be distinguished")
    elif max(means) - min(means) > SIMILAR_TEMPERATURE_C:
        texts.append(
            f"made at {min(means):.0f} to {max(means):.0f} °C: thermal drift and ageing cannot be distinguished"
        )
    return tuple(texts)
