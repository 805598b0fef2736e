"""The noise inflation factor: how much larger than white noise the noise is at the frequencies of a swing."""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import ZERO_PADDING, periodogram

Array = NDArray[np.float64]
SWING_BAND_HZ = (0.02, 1.5)
"""Band of the frequencies of swings and twice them; below it every fit removes the noise."""
MIN_BAND_BINS = 4
"""Fewest independent frequencies in the band that give a factor."""


def noise_inflation_factor(time_s: Array, residual: Array) -> float:
    """Return the spectral density of a residual (n, 3) in sigma in the band of swings, over that of white noise; at least 1.

    A fit of k parameters lowers the sum of squares of noise alone by k times this factor, so evidence is divided by it.
    """
    frequency_hz, power = periodogram(time_s, residual)
    lowest_hz = max(SWING_BAND_HZ[0], 2 / (time_s[-1] - time_s[0]))
    band = (frequency_hz > lowest_hz) & (frequency_hz < SWING_BAND_HZ[1])
    if band.sum() < MIN_BAND_BINS * ZERO_PADDING:
        return 1.0
    return max(1.0, float(power[band].mean()))
