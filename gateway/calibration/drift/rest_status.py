"""Status of the drift monitor at rest, as the `health` message reports it."""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.drift.rest_monitor import RestDriftMonitor, RestMean, RestReading, combine_means
from gateway.calibration.drift.trend import FORECAST_STEPS, HORIZON_DAYS, Trend, fit_means
from gateway.units import HOURS_PER_DAY

MIN_TREND_DAYS = 8
"""Least number of days with rest for a trend. Basis: a choice; a slope and a scatter with six degrees of freedom."""
MAX_TREND_POINTS = 32
"""Largest number of points of a trend. Basis: neighbouring days are combined, so that a fit takes milliseconds."""
MIN_TEMPERATURE_RANGE_C = 2.0
"""Least range of the days' temperatures, °C, at which the temperature is fitted together with time. Basis: a choice; several
steps of a thermometer, and less than a day outside has."""


@dataclass(frozen=True, slots=True)
class RestTrend:
    """Trend of the daily means of the magnitude."""

    days: int
    rate_mg_per_day: float
    rate95_mg_per_day: tuple[float, float]
    """95 % interval of the rate."""
    temperature_fitted: bool
    """Whether the rate is that at one temperature."""
    limit_in_days: float | None
    """Days until the upper end of the predicted error of the magnitude reaches the limit; None: not within ten years."""


@dataclass(frozen=True, slots=True)
class RestStatus:
    """Status of the record in force, judged at rest."""

    calibration_id: str
    state: str
    """`watching`, `alarm`, or `no_rest` before the first hour with rest."""
    norm_error_mg: float | None
    limit_mg: float | None
    trend: RestTrend | None
    shows: str
    """Which errors rest in this pose shows, and which it does not."""
    reasons: tuple[str, ...]


def judge_at_rest(monitor: RestDriftMonitor) -> RestStatus:
    """Return the status of a monitor; this takes some milliseconds, so it is called once an hour."""
    reading = monitor.reading()
    if reading is None:
        return RestStatus(monitor.record.id, "no_rest", None, None, None, "nothing yet: no hour with rest", ())
    return RestStatus(
        calibration_id=monitor.record.id,
        state="watching" if monitor.alarm_since_hour is None else "alarm",
        norm_error_mg=1000 * reading.norm_error_g,
        limit_mg=1000 * reading.limit_g,
        trend=_fit_trend(monitor.days, reading),
        shows=_describe_visibility(reading),
        reasons=_reasons(monitor, reading),
    )


def _fit_trend(days: tuple[RestMean, ...], reading: RestReading) -> RestTrend | None:
    if len(days) < MIN_TREND_DAYS:
        return None
    points = _thin_out(days)
    day = np.array([mean.hour for mean in points]) / HOURS_PER_DAY
    known = [mean.temperature_c for mean in points if mean.temperature_c is not None]
    is_fitted = len(known) == len(points) and max(known) - min(known) > MIN_TEMPERATURE_RANGE_C
    trend = fit_means(day, np.array([mean.norm_g - 1 for mean in points]), np.array(known) if is_fitted else None)
    return RestTrend(
        days=len(days),
        rate_mg_per_day=1000 * trend.rate,
        rate95_mg_per_day=(1000 * trend.rate_low, 1000 * trend.rate_high),
        temperature_fitted=is_fitted,
        limit_in_days=_days_to_limit(trend, float(day[-1]), reading.limit_g),
    )


def _thin_out(days: tuple[RestMean, ...]) -> list[RestMean]:
    """Return the means with neighbouring days combined until they are few enough."""
    points = list(days)
    while len(points) > MAX_TREND_POINTS:
        pairs = zip(points[::2], points[1::2], strict=False)
        points = [combine_means(*pair) for pair in pairs] + points[len(points) - len(points) % 2 :]
    return points


def _days_to_limit(trend: Trend, now_day: float, limit_g: float) -> float | None:
    ahead_days = np.concatenate([[0.0], np.geomspace(1, HORIZON_DAYS, FORECAST_STEPS)])
    mean, half = trend.predict(now_day + ahead_days)
    is_reached = np.abs(mean) + half >= limit_g
    return float(ahead_days[np.argmax(is_reached)]) if is_reached.any() else None


def _describe_visibility(reading: RestReading) -> str:
    weights = ", ".join(f"{weight:+.2f} {axis}" for axis, weight in zip("xyz", reading.direction, strict=True))
    return (
        f"one sum: zero-g offsets ({weights}) and the scale errors by the squares of these weights; "
        "an offset across the vertical reads as a lean and is not seen"
    )


def _reasons(monitor: RestDriftMonitor, reading: RestReading) -> tuple[str, ...]:
    texts = []
    if monitor.alarm_since_hour is not None:
        texts.append(
            f"the norm at rest deviates from 1 g by {1000 * reading.norm_error_g:+.1f} mg, "
            f"the limit is {1000 * reading.limit_g:.1f} mg: calibrate"
        )
    known = monitor.record.temperature_c
    if reading.temperature_c is not None and known and not known["min"] <= reading.temperature_c <= known["max"]:
        texts.append(
            f"{reading.temperature_c:.0f} °C is outside the calibration's {known['min']:.0f} to {known['max']:.0f} °C: "
            "thermal drift and ageing cannot be distinguished"
        )
    if monitor.misdated:
        texts.append(f"{monitor.misdated} readings were ignored: the clock was wrong")
    return tuple(texts)
