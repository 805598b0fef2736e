"""Drift from successive records of one device: trend of offset and scale per axis, and within how many days to recalibrate."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.drift.change import observable_change, reading_error_g
from gateway.calibration.drift.trend import Line, line_of_measurements
from gateway.calibration.record import CalibrationError, CalibrationRecord

Array = NDArray[np.float64]
DEFAULT_LIMIT_DEG = 0.5
"""Tilt error at which to recalibrate: a little above what 48 hours did to the sensor of 000 (0.43 degrees, eq. 20)."""
HORIZON_DAYS = 3650.0
"""As far ahead as is looked; nothing is promised for longer."""
STEPS_AHEAD = 200
MEASURING_METHODS = frozenset({"six-position", "norm-fit", "rotation"})
"""Records that measure offset and scale; others carry their parent's on."""
ALIKE_TEMPERATURE_C = 5.0
SECONDS_PER_DAY = 86_400.0


@dataclass(frozen=True, slots=True)
class AxisDrift:
    """Trends of one sensor axis, against the first record."""

    axis: str
    offset_g: Line
    """Zero-g offset, g and g a day."""
    scale: Line
    """Scale factor, relative and relative a day."""
    last_offset_g: float
    last_scale: float
    """As the last record measured them."""

    @property
    def shows_trend(self) -> bool:
        """The interval of a rate excludes zero."""
        return any(line.rate_low > 0 or line.rate_high < 0 for line in (self.offset_g, self.scale))

    def error_g(self, day: Array) -> tuple[Array, Array]:
        """Error of the last record on later days: what is expected, and the upper end of its 95 % interval (000 eq. 19), (m,).

        Offset and scale are measured apart from each other: their expected errors add up, their intervals by their squares.
        """
        offset_g, half_offset_g = self.offset_g.predict(day)
        scale, half_scale = self.scale.predict(day)
        expected = reading_error_g(offset_g - self.last_offset_g, scale - self.last_scale)
        return expected, expected + np.hypot(half_offset_g, half_scale)


@dataclass(frozen=True, slots=True)
class RecalibrateWithin:
    """When the error of the last record reaches the limit, in days after that record."""

    days: float
    """The upper end of the predicted error reaches the limit: recalibrate before."""
    expected_days: float | None
    """The expected error reaches it; None: not within the horizon."""
    axis: str
    limit_deg: float
    beyond_horizon: bool
    """The upper end stays below the limit as far as is looked; `days` is the horizon."""


@dataclass(frozen=True, slots=True)
class DriftReport:
    """What successive records show."""

    device_id: str
    records: int
    first_utc: str
    last_utc: str
    span_days: float
    axes: tuple[AxisDrift, AxisDrift, AxisDrift]
    within: RecalibrateWithin
    warnings: tuple[str, ...]


def drift_of(
    records: Sequence[CalibrationRecord],
    limit_deg: float = DEFAULT_LIMIT_DEG,
    wander_g_per_sqrt_day: float | None = None,
) -> DriftReport:
    """Trends over the records of one device, in any order; those that do not measure offset and scale are passed over.

    `wander_g_per_sqrt_day` is a known random walk of offset and scale error; None: found from the records, as far as they
    show it. Raises `CalibrationError` for fewer than two that measure, for two devices or units, and for records without
    uncertainties or with equal times.
    """
    measuring = sorted((record for record in records if record.method in MEASURING_METHODS), key=created)
    if len(measuring) < 2:
        raise CalibrationError(
            f"a drift needs two calibrations at least; of {len(records)} records, {len(measuring)} measured offset and scale"
        )
    seen = [observable_change(measuring[0], record) for record in measuring]
    day = np.array(
        [(created(record) - created(measuring[0])).total_seconds() / SECONDS_PER_DAY for record in measuring]
    )
    x, y, z = (
        AxisDrift(
            axis=name,
            offset_g=line_of_measurements(
                day,
                np.array([change.offset_g[axis] for change in seen]),
                np.array([change.u_offset_g[axis] for change in seen]),
                wander_g_per_sqrt_day,
            ),
            scale=line_of_measurements(
                day,
                np.array([change.scale[axis] for change in seen]),
                np.array([change.u_scale[axis] for change in seen]),
                wander_g_per_sqrt_day,
            ),
            last_offset_g=float(seen[-1].offset_g[axis]),
            last_scale=float(seen[-1].scale[axis]),
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
        within=_within((x, y, z), float(day[-1]), limit_deg),
        warnings=_warnings(records, measuring, (x, y, z)),
    )


def created(record: CalibrationRecord) -> datetime:
    """When a record was made; without a zone it is UTC. Raises `CalibrationError` for a text that is no time."""
    try:
        made = datetime.fromisoformat(record.created_utc)
    except ValueError as error:
        raise CalibrationError(f"record {record.id}: created_utc {record.created_utc!r} is no ISO 8601 time") from error
    return made if made.tzinfo is not None else made.replace(tzinfo=UTC)


def _within(axes: tuple[AxisDrift, ...], last_day: float, limit_deg: float) -> RecalibrateWithin:
    ahead_days = np.concatenate([[0.0], np.geomspace(1 / 24, HORIZON_DAYS, STEPS_AHEAD)])
    limit_g = np.sin(np.radians(limit_deg))
    reached = [(*_reached(axis, last_day, ahead_days, limit_g), axis.axis) for axis in axes]
    days, _, axis = min(reached, key=lambda entry: (entry[0], np.inf if entry[1] is None else entry[1]))
    expected = [entry[1] for entry in reached if entry[1] is not None]
    return RecalibrateWithin(
        days=float(min(days, HORIZON_DAYS)),
        expected_days=min(expected, default=None),
        axis=axis,
        limit_deg=limit_deg,
        beyond_horizon=bool(np.isinf(days)),
    )


def _reached(axis: AxisDrift, last_day: float, ahead_days: Array, limit_g: float) -> tuple[float, float | None]:
    """Last step at which the upper end, and the expected error, are still below the limit."""
    expected_g, upper_g = axis.error_g(last_day + ahead_days)
    expected, upper = expected_g >= limit_g, upper_g >= limit_g
    return (
        float(ahead_days[max(int(np.argmax(upper)) - 1, 0)]) if upper.any() else np.inf,
        float(ahead_days[max(int(np.argmax(expected)) - 1, 0)]) if expected.any() else None,
    )


def _warnings(
    records: Sequence[CalibrationRecord], measuring: Sequence[CalibrationRecord], axes: tuple[AxisDrift, ...]
) -> tuple[str, ...]:
    said = []
    if passed := len(records) - len(measuring):
        said.append(f"passed over: {passed} of {len(records)} records, which do not measure offset and scale")
    if len(measuring) == 2:
        said.append("two calibrations: a straight line between them cannot be checked")
    if not any(axis.shows_trend for axis in axes):
        said.append("no axis shows a trend: the days follow from what these records cannot exclude")
    if wandering := [axis.axis for axis in axes if axis.offset_g.contradicted or axis.scale.contradicted]:
        said.append(f"{', '.join(wandering)}: scatters about a line more than the uncertainties allow; no steady trend")
    means = [record.temperature_c["mean"] for record in measuring if record.temperature_c]
    if len(means) < len(measuring):
        said.append("a temperature is not known: thermal drift and ageing are not told apart")
    elif max(means) - min(means) > ALIKE_TEMPERATURE_C:
        said.append(f"made at {min(means):.0f} to {max(means):.0f} °C: thermal drift and ageing are not told apart")
    return tuple(said)
