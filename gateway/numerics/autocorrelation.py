"""Correlation of a series with itself at a lag."""

import math
from collections.abc import Iterator
from itertools import islice

from gateway.numerics.array import Array


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
