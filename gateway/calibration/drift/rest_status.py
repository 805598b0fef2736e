"""What the watch at rest has to say: one line for a person, a JSON object for `health`."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gateway.calibration.drift.rest_mean import RestMean, joined
from gateway.calibration.drift.rest_monitor import RestDriftMonitor, RestReading
from gateway.calibration.drift.trend import Line, line_of_means

FEWEST_DAYS = 8
MOST_POINTS = 32
HORIZON_DAYS = 3650.0
COVARIATE_C = 2.0
"""Range of temperature over the days from which on it is fitted beside time."""


@dataclass(frozen=True, slots=True)
class RestTrend:
    """A straight line through the daily means of the norm."""

    days: int
    rate_mg_per_day: float
    rate95_mg_per_day: tuple[float, float]
    temperature_fitted: bool
    """The rate is that at one temperature."""
    limit_in_days: float | None
    """From now until the upper end of the predicted norm error reaches the limit; None: not within ten years."""


@dataclass(frozen=True, slots=True)
class RestStatus:
    """How the record in force stands against rest."""

    calibration_id: str
    state: str
    """`watching`, `alarm`, or `no_rest` while no hour of rest has come since the record."""
    norm_error_mg: float | None
    limit_mg: float | None
    trend: RestTrend | None
    shows: str
    """What rest in this pose can show, and what not."""
    reasons: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """For the health message."""
        return asdict(self)


def rest_status(watch: RestDriftMonitor) -> RestStatus:
    """Judge what the watch holds; costs some milliseconds, so once an hour."""
    reading = watch.reading()
    if reading is None:
        return RestStatus(watch.record.id, "no_rest", None, None, None, "nothing yet: no hour with rest", ())
    return RestStatus(
        calibration_id=watch.record.id,
        state="watching" if watch.alarm_since_hour is None else "alarm",
        norm_error_mg=1000 * reading.norm_error_g,
        limit_mg=1000 * reading.limit_g,
        trend=_trend(watch.days, reading),
        shows=_shows(reading),
        reasons=_reasons(watch, reading),
    )


def _trend(days: tuple[RestMean, ...], reading: RestReading) -> RestTrend | None:
    if len(days) < FEWEST_DAYS:
        return None
    points = _thinned(days)
    day = np.array([mean.hour for mean in points]) / 24
    known = [mean.temperature_c for mean in points if mean.temperature_c is not None]
    fitted = len(known) == len(points) and max(known) - min(known) > COVARIATE_C
    line = line_of_means(day, np.array([mean.norm_g - 1 for mean in points]), np.array(known) if fitted else None)
    return RestTrend(
        days=len(days),
        rate_mg_per_day=1000 * line.rate,
        rate95_mg_per_day=(1000 * line.rate_low, 1000 * line.rate_high),
        temperature_fitted=fitted,
        limit_in_days=_until(line, float(day[-1]), reading.limit_g),
    )


def _thinned(days: tuple[RestMean, ...]) -> list[RestMean]:
    """Neighbouring days joined until few enough are left."""
    points = list(days)
    while len(points) > MOST_POINTS:
        pairs = zip(points[::2], points[1::2], strict=False)
        points = [joined(*pair) for pair in pairs] + points[len(points) - len(points) % 2 :]
    return points


def _until(line: Line, now_day: float, limit_g: float) -> float | None:
    ahead_days = np.concatenate([[0.0], np.geomspace(1, HORIZON_DAYS, 200)])
    mean, half = line.predict(now_day + ahead_days)
    reached = np.abs(mean) + half >= limit_g
    return float(ahead_days[np.argmax(reached)]) if reached.any() else None


def _shows(reading: RestReading) -> str:
    weights = ", ".join(f"{weight:+.2f} {axis}" for axis, weight in zip("xyz", reading.direction, strict=True))
    return (
        f"one sum: zero-g offsets ({weights}) and the scale errors by the squares of these; an offset across it reads as a "
        "lean and is not seen"
    )


def _reasons(watch: RestDriftMonitor, reading: RestReading) -> tuple[str, ...]:
    said = []
    if watch.alarm_since_hour is not None:
        said.append(
            f"at rest the norm left 1 g by over {1000 * reading.limit_g:.1f} mg and is {1000 * reading.norm_error_g:+.1f} mg off "
            "now: calibrate"
        )
    known = watch.record.temperature_c
    if reading.temperature_c is not None and known and not known["min"] <= reading.temperature_c <= known["max"]:
        said.append(
            f"{reading.temperature_c:.0f} °C is outside the calibration's {known['min']:.0f} to {known['max']:.0f} °C: "
            "warmth and ageing are not told apart"
        )
    if watch.misdated:
        said.append(f"{watch.misdated} readings were left aside: the clock was wrong")
    return tuple(said)
