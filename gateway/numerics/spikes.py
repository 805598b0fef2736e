"""Lone samples far from their neighbours."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gateway.numerics.array import Array

MIN_SPIKE_SIGMA = 8.0
"""Distance of a spike from its neighbours, in standard deviations of that distance. Basis: noise alone exceeds it once in some
10^14 samples of three axes."""
MAX_SPIKE_SHARE = 0.01
"""Largest share of the samples that can be spikes. Basis: a choice; more are a real event."""
MIN_SPIKE_SAMPLES = 8
"""Fewest samples in which a spike can be told from a motion. Basis: the stencils need six."""
STENCIL_REACH = 3
"""Samples on either side whose distance a spike changes, because it is one of their neighbours. Definition: of the stencils of
two neighbours on either side, or three on one."""
INTERIOR_DISTANCE_SIGMA = np.sqrt(1 + 34 / 36)
"""Standard deviation of an interior sample minus the cubic through two neighbours on either side, in sigma of one sample.
Definition: root of one and the squared weights (4, -1) / 6."""
END_DISTANCE_SIGMA = np.sqrt(20.0)
"""Standard deviation of an end sample minus the parabola through the next three, in sigma of one sample. Definition: root of one
and the squared weights 3, -3, 1."""


def lone_spikes(values: Array, noise: Array) -> NDArray[np.bool_]:
    """Return which samples (n, k) no smooth motion can have made, shape (n,); `noise` is 1 sigma per sample, shape (k,)."""
    count = len(values)
    if count < MIN_SPIKE_SAMPLES:
        return np.zeros(count, dtype=bool)
    v, distance = values, np.empty_like(values)
    distance[3:-3] = (v[3:-3] - (4 * (v[2:-4] + v[4:-2]) - v[1:-5] - v[5:-1]) / 6) / (INTERIOR_DISTANCE_SIGMA * noise)
    distance[:3] = _end_distance(v[:6]) / (END_DISTANCE_SIGMA * noise)
    distance[-3:] = _end_distance(v[:-7:-1])[::-1] / (END_DISTANCE_SIGMA * noise)
    size = np.abs(distance).max(axis=1)
    largest = sliding_window_view(np.pad(size, STENCIL_REACH), 2 * STENCIL_REACH + 1).max(axis=1)
    lone: NDArray[np.bool_] = (size > MIN_SPIKE_SIGMA) & (size == largest)
    return lone if lone.sum() <= max(MAX_SPIKE_SHARE * count, 1) else np.zeros(count, dtype=bool)


def _end_distance(values: Array) -> Array:
    """Return three samples minus the parabola through the three after each, of six samples (6, k)."""
    distance: Array = values[:3] - 3 * values[1:4] + 3 * values[2:5] - values[3:]
    return distance
