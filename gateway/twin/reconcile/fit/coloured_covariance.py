"""The covariance of fitted values under coloured noise, by the spectrum of the residual where the values show.

An estimate is a sum over the residual, theta = N^-1 J^T r, so its variance is N^-1 (integral of |J(f)|^2 S(f)) N^-1 with the
spectral density S of the residual: the sandwich with the long-run variance of the scores (Newey and West 1987), here in the
frequency domain, since the sensitivities of a swing are narrow lines.
"""

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit

Array = NDArray[np.float64]
SMOOTHING_BINS = (3, 7)
"""Numbers of frequencies over which the periodogram of the residual is averaged; the largest average counts. Few resolve a narrow
line and the slope of slow noise, more are steadier where a fit takes most of the power at its own frequency."""

MIN_POWER_LEFT = 0.2
"""Share of the power of noise below which what a fit leaves of it says nothing."""


def coloured_covariance(fit: Fit, observations: Observations) -> Array:
    """Return the covariance of the free values, shape (k, k).

    What the fit itself takes from the residual at the frequencies of its values is given back. The stated noise is the least.
    """
    white = fit.covariance()
    n = len(observations.time_s)
    spectrum = np.fft.rfft(fit.jacobian[..., fit.free], axis=0) / np.sqrt(n)  # (frequencies, 3, k)
    residual = np.fft.rfft(observations.residual_sigma(fit.force_g), axis=0) / np.sqrt(n)
    taken = np.einsum("fak,kl,fal->fa", spectrum.conj(), white, spectrum).real
    left = np.maximum(float(observations.used.mean()) - taken, 0.0)
    power = np.abs(residual) ** 2
    averages = [_smoothed(power, bins) / np.maximum(_smoothed(left, bins), MIN_POWER_LEFT) for bins in SMOOTHING_BINS]
    density = np.maximum(np.max(averages, axis=0), 1.0)
    both_sides = np.full(len(spectrum), 2.0)
    both_sides[0] = 1.0
    if n % 2 == 0:
        both_sides[-1] = 1.0
    scores = np.einsum("fa,fak,fal->kl", density * both_sides[:, None], spectrum.conj(), spectrum).real
    covariance: Array = white @ scores @ white
    return covariance


def _smoothed(values: Array, bins: int) -> Array:
    """Return the running mean over an odd number of frequencies (f, 3), mirrored at both ends."""
    reach = bins // 2
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="reflect")
    sums = np.cumsum(np.pad(padded, ((1, 0), (0, 0))), axis=0)
    means: Array = (sums[bins:] - sums[:-bins]) / bins
    return means
