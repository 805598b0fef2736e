"""Drift of a type of sensor, learned from all sensors of it: how long a calibration holds, and how well that is known.

The error of a reading of 1 g changes from the first calibration of a sensor to its last one by a random walk and by a rate of its
own: its variance is walk² t + rate² t², beside that of the two calibrations. Each sensor counts once, so that the sensors are
independent of each other; its axes are taken as independent, too. Both numbers follow from the likelihood of all sensors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gateway.calibration.drift.fleet_drift import SensorDrift
from gateway.calibration.drift.forecast import HORIZON_DAYS, MIN_SPAN_DAYS
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.units import HOURS_PER_DAY

MIN_SENSORS = 3
"""Sensors from which a type is learned. Basis: a choice; nine axes, whose spread is known within a half."""
SHARES = np.concatenate([[0.0], np.geomspace(1e-3, 30.0, 40)])
"""Candidates of each variance at the mean span, relative to the mean square of the changes. Basis: a choice; from what cannot be
seen to more than was ever seen, in steps by a factor of 1.3."""
HALF_CHI_SQUARE = 3.0
"""Log-likelihood below the largest one within which walk and rate are held possible together. Definition: half of the 95 %
quantile of chi-square with two degrees of freedom, since both are asked."""


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
