"""What loggers and ranges make of readings: repeated rows, zeros in place of a reading, the end of a range, lone spikes."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gateway.numerics.array import Array

MIN_HELD_READINGS = 20
"""Fewest different readings in succession from which a hold is judged. Basis: a choice; a share of a tenth is then two
readings."""
MIN_HELD_SHARE = 0.1
"""Least share of the readings that stand in more than one row, for the sensor to be slower than its file. Basis: a choice; equal
neighbours by chance are rarer with `MAX_CHANCE`, and a slower sensor repeats most."""
MAX_CHANCE = 0.01
"""Largest probability of three equal axes by chance, from which on equal rows are one reading. Basis: a choice; one wrong row in
a hundred changes no result."""
MAX_HOLD_ROWS = 50
"""Most rows of one reading. Basis: an axis that is equal for longer is stuck, or at rest in coarse steps."""
MIN_REGULAR_SHARE = 0.95
"""Least share of the readings that stand in a multiple of the same number of rows, or in that number and the next. Basis: by
chance 1 over that number, and at most 0.74 where a sinusoid without noise crosses steps."""
MAX_DROPOUT_SHARE = 0.05
"""Largest share of the rows. Basis: a choice; more zeros are a sensor that does not work, which is told as such."""
MIN_NEIGHBOUR_SHARE = 0.5
"""Norm of the rows around zeros over the median norm. Basis: a load in free fall reads little before it reads zero."""
MIN_DISTINCT_VALUES = 20
"""Fewest distinct readings. Basis: with fewer, coarse quantisation makes the extreme reading frequent by itself."""
MIN_EXTREME_READINGS = 8
"""Fewest readings at exactly the extreme value. Basis: a choice; chance seldom repeats an extreme, and a clipped swing has more
in a second."""
MIN_EXTREME_RATIO = 4
"""Readings at the extreme value over those at the next. Basis: the turning point of a sinusoid in steps gives 2.4."""
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


def find_fresh_rows(readings: Array) -> NDArray[np.bool_] | None:
    """Return which rows of (n, k) have a new reading, shape (n,); None where the sensor is not slower than its file.

    A row counts as repeated where all its columns equal the row before it exactly. Equal rows are taken for one held reading
    where chance cannot make them: either the steps are so fine that two readings hardly ever agree in all columns, or the rows of
    each reading are regular in number. A load at rest in coarse steps satisfies neither. Rows that are equal for longer than
    `MAX_HOLD_ROWS` are kept.
    """
    changed = np.diff(readings, axis=0) != 0
    first = np.flatnonzero(np.concatenate([[True], changed.any(axis=1)]))
    rows = np.diff(np.append(first, len(readings)))
    if len(rows) < MIN_HELD_READINGS or np.mean(rows > 1) < MIN_HELD_SHARE:
        return None
    if _chance_of_equal_readings(changed[first[1:] - 1]) > MAX_CHANCE and not _is_regular(rows[1:-1]):
        return None
    fresh = np.zeros(len(readings), dtype=np.bool_)
    fresh[first] = True
    return fresh | np.repeat(rows > MAX_HOLD_ROWS, rows)


def _chance_of_equal_readings(changed: NDArray[np.bool_]) -> float:
    """Return the probability that two readings agree in all columns; `changed` (m, k) are the columns that differ between them.

    The columns are taken as independent, each is judged by the readings of which another one differs.
    """
    chance = 1.0
    for column in range(changed.shape[1]):
        others = np.delete(changed, column, axis=1).any(axis=1)
        if np.count_nonzero(others) >= MIN_HELD_READINGS:
            chance *= 1.0 - float(changed[others, column].mean())
    return chance


def _is_regular(rows: NDArray[np.int64]) -> bool:
    """Return whether the readings stand in multiples of one number of rows, or in one of two successive numbers."""
    numbers = np.arange(2, MAX_HOLD_ROWS + 1)[:, None]
    multiples, neighbours = rows % numbers == 0, (rows == numbers) | (rows == numbers + 1)
    return bool(max(multiples.mean(axis=1).max(), neighbours.mean(axis=1).max()) >= MIN_REGULAR_SHARE)


def find_dropouts(readings: Array) -> NDArray[np.bool_]:
    """Return the dropouts: which rows of (n, 3) are zero in all axes though the rows around them read a weight, shape (n,).

    A logger writes zeros because it has no reading.
    """
    norm = np.linalg.norm(readings, axis=1)
    zero = norm == 0
    present = np.flatnonzero(~zero)
    if not 0 < zero.sum() <= MAX_DROPOUT_SHARE * len(zero):
        return np.zeros(len(zero), dtype=np.bool_)
    after = np.searchsorted(present, np.arange(len(zero)))
    before = norm[present[np.maximum(after - 1, 0)]]
    beyond = norm[present[np.minimum(after, len(present) - 1)]]
    has_weight = np.minimum(before, beyond) > MIN_NEIGHBOUR_SHARE * np.median(norm[present])
    return np.asarray(zero & has_weight, dtype=np.bool_)


def saturation_level(values: Array) -> float | None:
    """Return the extreme value of readings (n,) that occurs too often for a motion; None where neither end does."""
    distinct, counts = np.unique(values, return_counts=True)
    if len(distinct) < MIN_DISTINCT_VALUES:
        return None
    for extreme, next_to_it in ((-1, -2), (0, 1)):
        if counts[extreme] >= MIN_EXTREME_READINGS and counts[extreme] > MIN_EXTREME_RATIO * counts[next_to_it]:
            return float(distinct[extreme])
    return None


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
