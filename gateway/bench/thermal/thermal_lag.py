"""Lag between the element that measures and the thermometer beside it: the two have not one temperature, one follows the other.

element = thermometer + lag d(thermometer)/dt          the thermometer follows the element
element = thermometer behind a low-pass of -lag        the element follows the thermometer
"""

from collections.abc import Callable, Sequence

import numpy as np

from gateway.bench.thermal.slow_noise import RecordingCoefficients
from gateway.numerics.array import Array

AVERAGE_S = 0.5
"""Duration of an average, s; 20 Hz were averaged to 2 Hz (Sawicki and Walendziuk 2016, sec. 3)."""
PRIOR_LAG_S = 5.0
"""Standard uncertainty of the lag before anything is measured, s. Basis: a choice; packages follow the air within seconds, a lag
of a minute shows in any ramp, and ramps that do not show one keep their temperatures."""
LAG_STEP_S = 0.25
"""Step of the derivative by the lag, s. Basis: a choice; half an average."""
LAG_ITERATIONS = 5
"""Gauss-Newton steps of the lag. Basis: a choice; three settle it to a hundredth of its uncertainty."""


def element_c(time_s: Array, thermometer_c: Array, lag_s: float) -> Array:
    """Return the temperature of the element, °C, shape (n,), from averages at even times, both shape (n,)."""
    if lag_s >= 0:
        return np.asarray(thermometer_c + lag_s * np.gradient(thermometer_c, time_s))
    step_s = float(np.median(np.diff(time_s)))
    keep = float(np.exp(step_s / lag_s))
    now = 1 + (1 - keep) * lag_s / step_s  # a low-pass that is exact for a line between the averages
    kernel = np.concatenate([[now], (1 - now) * (1 - keep) * keep ** np.arange(len(time_s) - 1)])
    before = np.full(len(kernel) - 1, thermometer_c[0])
    return np.convolve(np.concatenate([before, thermometer_c]), kernel / kernel.sum(), "valid")


def fit_lag(fits: Callable[[float], Sequence[RecordingCoefficients]], lag_s: float) -> tuple[float, float]:
    """Return the lag and its standard uncertainty by Gauss-Newton; `fits` returns the fits of all axes at a lag.

    Whether there is a lag at all is as open beforehand as not: the result is the mean over both, weighted by their evidence, so
    that ramps that hardly show a lag do not shift the temperatures by its noise.
    """
    u_lag_s = PRIOR_LAG_S
    for _ in range(LAG_ITERATIONS):
        pairs = list(zip(fits(lag_s - LAG_STEP_S), fits(lag_s + LAG_STEP_S), strict=True))
        behind = np.concatenate([one.residual / one.sigma for one, _ in pairs])
        ahead = np.concatenate([other.residual / one.sigma for one, other in pairs])
        slope = (ahead - behind) / (2 * LAG_STEP_S)
        u_lag_s = float(1 / np.sqrt(slope @ slope + PRIOR_LAG_S**-2))
        lag_s -= u_lag_s**2 * float(slope @ (ahead + behind) / 2 + lag_s * PRIOR_LAG_S**-2)
    odds = u_lag_s / PRIOR_LAG_S * np.exp(min((lag_s / u_lag_s) ** 2 / 2, 700.0))
    share = odds / (1 + odds)
    return share * lag_s, float(np.sqrt(share * u_lag_s**2 + share * (1 - share) * lag_s**2))
