"""Statistics: quantiles, means by group, estimates that a few outliers do not change, runs and steps, autocorrelation."""

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

_STANDARD_NORMAL = NormalDist()
_QUADRATURE_NODES, _QUADRATURE_WEIGHTS = np.polynomial.legendre.leggauss(32)
"""Basis: a choice; 32 nodes integrate the density of any degree of freedom in use to rounding."""
CHANCE_LEVEL = 0.99
"""Probability with which stated uncertainties alone keep chi-square below its limit. Basis: a choice; one sound calibration in a
hundred is called in question."""


def normal_quantile(probability: float) -> float:
    """Return the value that a standard normal variable stays below with this probability."""
    return _STANDARD_NORMAL.inv_cdf(probability)


NORMAL_975 = normal_quantile(0.975)
"""Definition: coverage factor of a two-sided 95 % interval of a normal variable."""


def student_quantile(probability: float, freedom: float) -> float:
    """Return the value that Student's t stays below with this probability, at least 1/2; `freedom` need not be whole.

    With t = sqrt(freedom) tan(angle) the density becomes a power of a cosine. Its integral is concave in the angle, so Newton's
    method from 0 approaches the solution from below.
    """
    scale = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(math.pi)
    angle, step = 0.0, math.inf
    while step > 1e-12:
        nodes = angle / 2 * (1 + _QUADRATURE_NODES)
        below = scale * angle / 2 * float(_QUADRATURE_WEIGHTS @ np.cos(nodes) ** (freedom - 1))
        step = (probability - 0.5 - below) / (scale * math.cos(angle) ** (freedom - 1))
        angle += step
    return math.sqrt(freedom) * math.tan(angle)


def chi_square_quantile(probability: float, freedom: float) -> float:
    """Return the value that chi-square stays below with this probability (Wilson and Hilferty 1931)."""
    variance = 2 / (9 * freedom)
    return freedom * (1 - variance + normal_quantile(probability) * math.sqrt(variance)) ** 3


def smallest_steps(values: Array) -> Array:
    """Return the smallest difference between two different readings of each column of (n, k); 0 where all are equal."""
    steps = np.diff(np.sort(values, axis=0), axis=0)
    smallest = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
    return np.where(np.isfinite(smallest), smallest, 0.0)


MAD_TO_SIGMA = 1 / normal_quantile(0.75)
"""Standard deviation of a normal variable over its median absolute deviation, 1.4826. Definition: of a normal variable."""


def robust_sigma(deviations: Array) -> Array:
    """Return the standard deviation of each column of deviations (n, ...) from their centre, by the median of their size."""
    return np.asarray(MAD_TO_SIGMA * np.median(np.abs(deviations), axis=0), dtype=np.float64)


def true_runs(flags: Sequence[bool] | NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return each run of True as (index of its first element, index after its last)."""
    edges = np.diff(np.concatenate([[False], np.asarray(flags, dtype=bool), [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [(int(start), int(stop)) for start, stop in zip(starts, stops, strict=True)]


def means_by_group(group: Array, values: Array) -> tuple[Array, Array]:
    """Return the means of the rows of each group, shape (g, k), and the standard deviation of a row within groups, (k,).

    Groups, one number for each of the rows (n, k), are in rising order.
    """
    _, place, count = np.unique(group, return_inverse=True, return_counts=True)
    means = np.column_stack([np.bincount(place, column) / count for column in values.T])
    freedom = max(len(values) - len(count), 1)
    return means, np.sqrt(((values - means[place]) ** 2).sum(axis=0) / freedom)


def autocorrelations(values: Array) -> Iterator[float]:
    """Yield the autocorrelation of a series (n,) at lags 1, 2, ... n - 1; nothing for a constant series."""
    centred = values - values.mean()
    power = float(centred @ centred)
    if power > 0.0:
        for lag in range(1, len(values)):
            yield float(centred[lag:] @ centred[:-lag]) / power


def correlation_sum(values: Array) -> float:
    """Return 1 + 2 sum of the autocorrelation, the factor by which correlation multiplies the variance of a mean (Sokal 1997).

    The sum ends where the autocorrelation first falls below twice its own standard uncertainty, at the latest at n/4.
    """
    total, limit = 1.0, 2 / math.sqrt(len(values))
    for correlation in islice(autocorrelations(values), max(1, len(values) // 4 - 1)):
        if correlation < limit:
            break
        total += 2 * correlation
    return total
