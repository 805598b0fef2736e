"""Readings in steps."""

import numpy as np

from gateway.numerics.array import Array


def smallest_steps(values: Array) -> Array:
    """Return the smallest difference between two different readings of each column of (n, k); 0 where all are equal."""
    steps = np.diff(np.sort(values, axis=0), axis=0)
    smallest = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
    return np.where(np.isfinite(smallest), smallest, 0.0)
