"""Readings that a sensor slower than its file holds over several rows (sample and hold)."""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

MIN_READINGS = 20
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
    if len(rows) < MIN_READINGS or np.mean(rows > 1) < MIN_HELD_SHARE:
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
        if np.count_nonzero(others) >= MIN_READINGS:
            chance *= 1.0 - float(changed[others, column].mean())
    return chance


def _is_regular(rows: NDArray[np.int64]) -> bool:
    """Return whether the readings stand in multiples of one number of rows, or in one of two successive numbers."""
    numbers = np.arange(2, MAX_HOLD_ROWS + 1)[:, None]
    multiples, neighbours = rows % numbers == 0, (rows == numbers) | (rows == numbers + 1)
    return bool(max(multiples.mean(axis=1).max(), neighbours.mean(axis=1).max()) >= MIN_REGULAR_SHARE)
