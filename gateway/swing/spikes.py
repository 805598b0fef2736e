"""Lone samples far from what their neighbours say: left out before anything is averaged."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gateway.swing.model import Real

SIGMA = 8.0
"""Of the difference from the neighbours' cubic."""
MOST = 0.01
"""Share of the samples; more than that are not spikes but something that happens."""
FEWEST_SAMPLES = 8
REACH = 3
"""Samples on either side that a spike throws off."""
_WITHIN = np.sqrt(1 + 34 / 36)
"""Noise of a sample less the cubic through two neighbours on either side, over the noise of one sample."""
_AT_END = np.sqrt(20.0)
"""The same of an end sample less the parabola through the next three."""


def lone_spikes(force_g: Real, noise_g: Real) -> NDArray[np.bool_]:
    """Which samples of specific force, shape (n, 3), no smooth motion can have made; noise per sample and axis, shape (3,)."""
    count = len(force_g)
    if count < FEWEST_SAMPLES:
        return np.zeros(count, dtype=bool)
    f, away = force_g, np.empty_like(force_g)
    away[3:-3] = (f[3:-3] - (4 * (f[2:-4] + f[4:-2]) - f[1:-5] - f[5:-1]) / 6) / (_WITHIN * noise_g)
    away[:3] = _beyond(f[:6]) / (_AT_END * noise_g)
    away[-3:] = _beyond(f[:-7:-1])[::-1] / (_AT_END * noise_g)
    size = np.abs(away).max(axis=1)
    largest = sliding_window_view(np.pad(size, REACH), 2 * REACH + 1).max(axis=1)
    lone: NDArray[np.bool_] = (size > SIGMA) & (size == largest)
    return lone if lone.sum() <= max(MOST * count, 1) else np.zeros(count, dtype=bool)


def _beyond(force_g: Real) -> Real:
    """Three samples less the parabola through the three after each, of six, shape (6, 3)."""
    away: Real = force_g[:3] - 3 * force_g[1:4] + 3 * force_g[2:5] - force_g[3:]
    return away
