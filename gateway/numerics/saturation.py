"""Readings that stop at the end of a range that is not known."""

import numpy as np

from gateway.numerics.array import Array

MIN_DISTINCT_VALUES = 20
"""Fewest distinct readings. Basis: with fewer, coarse quantisation makes the extreme reading frequent by itself."""
MIN_EXTREME_READINGS = 8
"""Fewest readings at exactly the extreme value. Basis: a choice; chance seldom repeats an extreme, and a clipped swing has more
in a second."""
MIN_EXTREME_RATIO = 4
"""Readings at the extreme value over those at the next. Basis: the turning point of a sinusoid in steps gives 2.4."""


def saturation_level(values: Array) -> float | None:
    """Return the extreme value of readings (n,) that occurs too often for a motion; None where neither end does."""
    distinct, counts = np.unique(values, return_counts=True)
    if len(distinct) < MIN_DISTINCT_VALUES:
        return None
    for extreme, next_to_it in ((-1, -2), (0, 1)):
        if counts[extreme] >= MIN_EXTREME_READINGS and counts[extreme] > MIN_EXTREME_RATIO * counts[next_to_it]:
            return float(distinct[extreme])
    return None
