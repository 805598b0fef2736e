"""The times between which the motion is integrated: regular ones, and the edges of events."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CLOSEST_S = 1e-6
"""A regular node nearer than this to an edge is left out."""


@dataclass(frozen=True, slots=True)
class SampleTimes:
    """Instants and their derivatives by the parameters."""

    at_s: Array
    """Shape (n,)."""
    by: Array
    """Shape (n, parameters)."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Nodes in rising order."""

    nodes_s: Array
    """Shape (nodes,)."""
    nodes_by: Array
    """Derivatives by the parameters, shape (nodes, parameters)."""
    kicks: dict[int, int]
    """Nodes at which the state jumps, and by which edge."""

    @property
    def steps_s(self) -> Array:
        """Shape (nodes - 1,)."""
        return np.diff(self.nodes_s)


def grid(bounds: SampleTimes, edges: SampleTimes, kicking: Collection[int], step_s: float) -> Grid:
    """Nodes from the first bound to the second, no further apart than `step_s`, and at each edge between them."""
    first_s, last_s = bounds.at_s
    steps = max(1, int(np.ceil((last_s - first_s) / step_s - 1e-9)))
    regular_s = np.linspace(first_s, last_s, steps + 1)
    regular_by = np.zeros((steps + 1, bounds.by.shape[1]))
    regular_by[[0, -1]] = bounds.by
    inside = np.flatnonzero((edges.at_s > first_s + CLOSEST_S) & (edges.at_s < last_s - CLOSEST_S))
    apart = np.abs(regular_s[:, None] - edges.at_s[inside]).min(axis=1, initial=np.inf) > CLOSEST_S
    apart[[0, -1]] = True
    nodes_s = np.concatenate([regular_s[apart], edges.at_s[inside]])
    order = np.argsort(nodes_s, kind="stable")
    node_of = np.empty_like(order)
    node_of[order] = np.arange(len(order))
    kicks = {int(node_of[apart.sum() + i]): int(edge) for i, edge in enumerate(inside) if edge in kicking}
    return Grid(nodes_s[order], np.concatenate([regular_by[apart], edges.by[inside]])[order], kicks)
