"""The nodes between which the motion is integrated: regular ones, and the discontinuities of events."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MIN_SPACING_S = 1e-6
"""A regular node closer than this to a discontinuity is left out. Basis: a choice; above rounding, far below a step."""
RAMP_STEPS = 8
"""Least steps between two discontinuities. Basis: a force may rise from one to the next."""
ROUNDING_STEPS = 1e-9
"""Excess over a whole number of steps that is a rounding error. Basis: above rounding (1e-16) of some million steps."""


@dataclass(frozen=True, slots=True)
class Times:
    """Times and their derivatives by the parameters."""

    time_s: Array
    """Shape (n,)."""
    by: Array
    """Shape (n, parameters)."""


@dataclass(frozen=True, slots=True)
class IntegrationGrid:
    """Nodes in ascending order."""

    nodes_s: Array
    """Shape (nodes,)."""
    nodes_by: Array
    """Derivatives by the parameters, shape (nodes, parameters)."""
    impulses: dict[int, int]
    """Nodes at which the state jumps, each with the index of its discontinuity."""

    @property
    def steps_s(self) -> Array:
        """Lengths of the steps, shape (nodes - 1,)."""
        return np.diff(self.nodes_s)


def make_grid(bounds: Times, discontinuities: Times, with_impulse: Collection[int], step_s: float) -> IntegrationGrid:
    """Return nodes from the first bound to the second, at most `step_s` apart, with one at each discontinuity between them."""
    first_s, last_s = bounds.time_s
    steps = max(1, int(np.ceil((last_s - first_s) / step_s - ROUNDING_STEPS)))
    regular_s = np.linspace(first_s, last_s, steps + 1)
    regular_by = np.linspace(bounds.by[0], bounds.by[1], steps + 1)
    inside = np.flatnonzero(
        (discontinuities.time_s > first_s + MIN_SPACING_S) & (discontinuities.time_s < last_s - MIN_SPACING_S)
    )
    distance_s = np.abs(regular_s[:, None] - discontinuities.time_s[inside]).min(axis=1, initial=np.inf)
    kept = distance_s > MIN_SPACING_S
    kept[[0, -1]] = True
    ramps = _inside_ramps(Times(discontinuities.time_s[inside], discontinuities.by[inside]), step_s)
    nodes_s = np.concatenate([regular_s[kept], discontinuities.time_s[inside], ramps.time_s])
    order = np.argsort(nodes_s, kind="stable")
    node_of = np.empty_like(order)
    node_of[order] = np.arange(len(order))
    impulses = {int(node_of[kept.sum() + i]): int(each) for i, each in enumerate(inside) if each in with_impulse}
    nodes_by = np.concatenate([regular_by[kept], discontinuities.by[inside], ramps.by])
    return IntegrationGrid(nodes_s[order], nodes_by[order], impulses)


def _inside_ramps(discontinuities: Times, step_s: float) -> Times:
    """Return nodes between discontinuities that are so close to each other that regular nodes are too few."""
    order = np.argsort(discontinuities.time_s, kind="stable")
    times_s, by = discontinuities.time_s[order], discontinuities.by[order]
    gaps_s = np.diff(times_s)
    short = np.flatnonzero((gaps_s > MIN_SPACING_S) & (gaps_s < RAMP_STEPS * step_s))
    share = np.arange(1, RAMP_STEPS)[:, None] / RAMP_STEPS
    inside_by = by[short] + share[:, :, None] * np.diff(by, axis=0)[short]
    return Times(
        (times_s[short] + share * gaps_s[short]).ravel(), inside_by.reshape(share.size * len(short), by.shape[1])
    )
