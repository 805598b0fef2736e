"""Scan for changepoints: free trajectories before and after every window of a recording.

A transient effect leaves the load in another free trajectory. With the sensitivities to the initial state this is linear, and
cumulative sums give the fit for every window at once (generalised likelihood ratio, Basseville and Nikiforov 1993).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.levenberg_marquardt import solve_damped

Array = NDArray[np.float64]
TIME_RESOLUTION_S = 0.5
"""Resolution of changepoints: grid of a scan, length of a tested block, margin around an event that is left out."""
MAX_LENGTHS_S = (0.0, 5.0, 12.0, 25.0)
"""The best window up to each of these lengths is found; the longest is also that of the longest event."""
MARGIN_S = 4.0
"""Shortest trajectory before the first and after the last window, most of a period."""
INSIDE_COST = 3.05
"""Chi-square of a sample inside a window: that of its three values, and a little, so that of equal windows the shortest wins."""
RIDGE = 1e-9
"""Added to the scaled diagonal, for trajectories too short to determine the whole initial state."""


def scan_for_changepoints(
    time_s: Array, residual: Array, jacobian: Array, used: NDArray[np.bool_]
) -> tuple[EventWindow, ...]:
    """Return the best window up to each of `MAX_LENGTHS_S`; none in a recording that is all margin.

    The residual (n, 3) is in sigma, and so is the jacobian (n, 3, k) by the values that may differ before and after.
    """
    edges_s = np.arange(MARGIN_S, time_s[-1] - MARGIN_S, TIME_RESOLUTION_S)
    if not len(edges_s):
        return ()
    edges = np.searchsorted(time_s, edges_s)
    sums = _CumulativeSums.of(residual, jacobian, used)
    before = np.array([sums.chi2(0, edge) for edge in edges])
    after = np.array([sums.chi2(edge, len(time_s)) for edge in edges])
    inside = INSIDE_COST * (sums.count[edges][None, :] - sums.count[edges][:, None])
    remaining_chi2 = before[:, None] + after[None, :] + inside
    length_s = edges_s[None, :] - edges_s[:, None]
    windows = []
    for max_length_s in MAX_LENGTHS_S:
        allowed = np.where((length_s >= 0) & (length_s <= max_length_s), remaining_chi2, np.inf)
        i, j = np.unravel_index(np.argmin(allowed), allowed.shape)
        windows.append(EventWindow(float(edges_s[i]), float(edges_s[j]), float(allowed[i, j])))
    return tuple(windows)


def exclude_unmodelled_profiles(log: Observations, effects: EffectValues) -> Observations:
    """Return the log without the samples during events whose exact course no model knows.

    A winch starts and stops, and a struck object yields, in its own way. An event that lasts longer is not excluded.
    """
    outside = np.ones(len(log.time_s), dtype=np.bool_)
    for name, values in effects.items():
        interval_s = None if EFFECTS[name].profile_modelled else EFFECTS[name].interval_s(values)
        if interval_s is not None and interval_s[1] - interval_s[0] <= MAX_LENGTHS_S[-1]:
            start_s, end_s = interval_s
            outside &= (log.time_s < start_s - TIME_RESOLUTION_S) | (log.time_s > end_s + TIME_RESOLUTION_S)
    return replace(log, used=log.used & outside)


@dataclass(frozen=True, slots=True)
class _CumulativeSums:
    """Normal equations summed up to each sample."""

    count: Array
    square: Array
    gradient: Array
    normal: Array

    @staticmethod
    def of(residual: Array, jacobian: Array, used: NDArray[np.bool_]) -> "_CumulativeSums":
        def cumulative(values: Array) -> Array:
            return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])

        return _CumulativeSums(
            cumulative(used.astype(float)),
            cumulative((residual**2).sum(axis=1)),
            cumulative(np.einsum("nij,ni->nj", jacobian, residual)),
            cumulative(np.einsum("nij,nik->njk", jacobian, jacobian)),
        )

    def chi2(self, first: int, last: int) -> float:
        """Return chi-square of the samples from `first` to before `last` after a fit of their own."""
        normal, gradient = self.normal[last] - self.normal[first], self.gradient[last] - self.gradient[first]
        drop = solve_damped(normal, gradient, RIDGE) @ gradient
        return float(self.square[last] - self.square[first] - drop)
