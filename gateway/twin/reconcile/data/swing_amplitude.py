"""The amplitude of a swing, from the samples alone."""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import ZERO_PADDING

Array = NDArray[np.float64]
LARGE_AMPLITUDE_RAD = 0.45
"""Amplitude beyond which a fit needs initial conditions from the samples: one that starts at rest does not converge."""
ASKEW_RAD = 0.17
"""Angle of the mean reading to the z axis from which the housing hangs askew: beyond the lean of a load in a strong wind."""
INITIAL_SHARE = 0.25
"""Share of the recording, from its start, that determines the amplitude. A short share shows a swing that decays; an event that
sets a load at rest in motion usually comes later."""
AXIAL_QUANTILE = 0.02
"""Quantile of the axial reading that stands for its value at the turning points, without the outliers of the noise."""
HALF_FREQUENCY_TOLERANCE = 0.4
"""Relative tolerance within which the swing's frequency is half that of the axial reading."""
MIN_SWING_POWER_SHARE = 0.1
"""Least share of the lateral power at the swing's frequency."""


def make_upright(force_g: Array) -> Array:
    """Return samples (n, 3) in axes whose z is the mean reading, where the housing hangs well askew; else the samples themselves.

    A load at rest would read 1 g along z then. The axes are turned about the line at right angles to both (Rodrigues).
    """
    used = force_g[np.isfinite(force_g).all(axis=1)]
    mean = used.mean(axis=0) / max(float(np.linalg.norm(used.mean(axis=0))), 1e-9)
    if mean[2] > np.cos(ASKEW_RAD) or mean[2] < 0:
        return force_g
    x, y, z = mean
    skew = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    upright: Array = force_g @ (np.eye(3) + skew + skew @ skew / (1 + z)).T
    return upright


def estimate_amplitude_rad(time_s: Array, force_g: Array, used: NDArray[np.bool_]) -> float:
    """Return the amplitude at the start of a recording: at a turning point the rope carries cos(amplitude) of the weight.

    This holds wherever the housing is on the rope. Of the samples (n, 3) only those in `used` (n,) count.
    """
    low_g = float(np.quantile(force_g[used & _is_initial(time_s), 2], AXIAL_QUANTILE))
    return float(np.arccos(np.clip(low_g, -1.0, 1.0)))


def has_swing_at_half_axial_frequency(time_s: Array, force_g: Array) -> bool:
    """Return whether the lateral readings have a line at half the frequency of the axial one.

    The rope force of a swing has two minima per period. A load that bounces on the rope has no such line.
    """
    initial = force_g[_is_initial(time_s)]
    windowed = (initial - initial.mean(axis=0)) * np.hanning(len(initial))[:, None]
    power = np.abs(np.fft.rfft(windowed, ZERO_PADDING * len(initial), axis=0)) ** 2
    half = np.argmax(power[:, 2]) / 2
    near = slice(int((1 - HALF_FREQUENCY_TOLERANCE) * half), int((1 + HALF_FREQUENCY_TOLERANCE) * half) + 1)
    lateral = power[:, :2].sum(axis=1)
    return bool(lateral[near].sum() > MIN_SWING_POWER_SHARE * lateral.sum())


def _is_initial(time_s: Array) -> NDArray[np.bool_]:
    initial: NDArray[np.bool_] = time_s <= INITIAL_SHARE * float(time_s[-1] - time_s[0])
    return initial
