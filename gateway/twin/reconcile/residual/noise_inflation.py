"""How much louder than white the noise is where a swing lives: evidence is counted in units of that."""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import ZERO_PADDING, periodogram

Array = NDArray[np.float64]
SWING_BAND_HZ = (0.02, 1.5)
"""Band of a load's swing and twice that; below, every fit takes the noise away."""
MIN_INFLATION = 1.0


def noise_inflation_factor(time_s: Array, residual: Array) -> float:
    """Spectral density of a residual (n, 3) in sigma over that of white noise of one sigma, in the band of swings; 1 or more.

    A sum of squares that a fit with k parameters takes from noise alone is k times this, not k.
    """
    frequency_hz, power = periodogram(time_s, residual)
    band = (frequency_hz > max(SWING_BAND_HZ[0], 2 / (time_s[-1] - time_s[0]))) & (frequency_hz < SWING_BAND_HZ[1])
    if band.sum() < 4 * ZERO_PADDING:
        return MIN_INFLATION
    return max(MIN_INFLATION, float(power[band].mean()))
