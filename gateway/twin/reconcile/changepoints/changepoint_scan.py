"""When something happened: the free motion before a window and the free motion after it are fitted each for itself.

Whatever acts on the load for a time leaves it in another free motion. With the sensitivities by the initial motion this is
linear, and running sums give the fit for every pair of edges at once.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import Observations

Array = NDArray[np.float64]
GRID_S = 0.5
MAX_LENGTHS_S = (0.0, 5.0, 12.0, 25.0)
"""Windows up to each of these lengths are looked for: a long one also frees what a blow leaves unexplained around it."""
MARGIN_S = 4.0
COST_INSIDE = 3.05
"""Each sample inside counts as noise and a little more, so that the shortest of equal windows wins."""
PROFILE_MARGIN_S = 0.5
"""Left out before and after an event whose exact course is not modelled."""


def scan_for_changepoints(
    time_s: Array, residual: Array, jacobian: Array, used: NDArray[np.bool_]
) -> tuple[EventWindow, ...]:
    """The best window up to each length; residual (n, 3) in sigma, jacobian (n, 3, k) by what changes from before to after."""
    edges_s = np.arange(MARGIN_S, time_s[-1] - MARGIN_S, GRID_S)
    places = np.searchsorted(time_s, edges_s)
    sums = _RunningSums.of(residual, jacobian, used)
    before = np.array([sums.cost(0, place) for place in places])
    after = np.array([sums.cost(place, len(time_s)) for place in places])
    inside = COST_INSIDE * (sums.count[places][None, :] - sums.count[places][:, None])
    cost = before[:, None] + after[None, :] + inside
    length_s = edges_s[None, :] - edges_s[:, None]
    found = []
    for longest_s in MAX_LENGTHS_S:
        allowed = np.where((length_s >= 0) & (length_s <= longest_s), cost, np.inf)
        i, j = np.unravel_index(np.argmin(allowed), cost.shape)
        found.append(EventWindow(float(edges_s[i]), float(edges_s[j]), float(allowed[i, j])))
    return tuple(found)


def exclude_unmodelled_profiles(log: Observations, effects: EffectValues) -> Observations:
    """The log without the samples while the rope changed its length and while a blow struck.

    How a winch starts and stops, and how what is struck gives way, is its own; what takes longer than an event is not left out.
    """
    away = np.ones(len(log.time_s), dtype=np.bool_)
    for name, values in effects.items():
        interval_s = None if EFFECTS[name].profile_modelled else EFFECTS[name].interval_s(values)
        if interval_s is not None and interval_s[1] - interval_s[0] <= MAX_LENGTHS_S[-1]:
            start_s, end_s = interval_s
            away &= (log.time_s < start_s - PROFILE_MARGIN_S) | (log.time_s > end_s + PROFILE_MARGIN_S)
    return replace(log, used=log.used & away)


@dataclass(frozen=True, slots=True)
class _RunningSums:
    count: Array
    square: Array
    gradient: Array
    normal: Array

    @staticmethod
    def of(residual: Array, jacobian: Array, used: NDArray[np.bool_]) -> "_RunningSums":
        def running(values: Array) -> Array:
            return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])

        return _RunningSums(
            running(used.astype(float)),
            running((residual**2).sum(axis=1)),
            running(np.einsum("nij,ni->nj", jacobian, residual)),
            running(np.einsum("nij,nik->njk", jacobian, jacobian)),
        )

    def cost(self, first: int, last: int) -> float:
        """Chi-square of samples first to last - 1 with a motion of their own."""
        normal, gradient = self.normal[last] - self.normal[first], self.gradient[last] - self.gradient[first]
        scale = np.sqrt(np.diag(normal)) + 1e-12
        matrix = normal / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        solved = np.linalg.solve(matrix, gradient / scale)
        return float(self.square[last] - self.square[first] - solved @ (gradient / scale))
