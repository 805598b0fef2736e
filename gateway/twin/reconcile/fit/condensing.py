"""Condensing: the elimination of the later segments' initial states from a step of multiple shooting.

By the linearised continuity constraints, the initial state of each segment follows from that of the first segment and from the
effect values (Bock 1981; Albersmeyer and Diehl 2010). The normal equations are then as small as in single shooting.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.simulator.simulator import SegmentBatch
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CondensedSystem:
    """A linearised least-squares problem in the first initial state and the effect values, together the values."""

    residual: Array
    """In sigma, after the discontinuities are closed to first order, shape (n, 3)."""
    jacobian: Array
    """Derivatives by the values, in sigma, shape (n, 3, values)."""
    closing_step: Array
    """Step of the initial states that closes the discontinuities, shape (segments, states)."""
    states_by_values: Array
    """Derivatives of the initial states by the values, shape (segments, states, values)."""
    largest_discontinuity: float
    """Largest difference between the end of a segment and the initial state of the next, rad or rad/s."""

    @property
    def chi2(self) -> float:
        """Sum of the squared residual."""
        return float((self.residual**2).sum())

    def states_after(self, initial_states: Array, step: Array) -> Array:
        """Return the initial states (segments, states) after a step of the values."""
        moved: Array = initial_states + self.closing_step + self.states_by_values @ step
        return moved


def condense(
    batch: SegmentBatch, observations: Observations, initial_states: Array, first_samples: Sequence[int]
) -> CondensedSystem:
    """Return the condensed system of a linearisation over segments that begin at `first_samples`."""
    n_states = initial_states.shape[1]
    n_values = n_states + batch.force_by_effects.shape[2]
    discontinuities = batch.ends[:-1] - initial_states[1:]
    discontinuities[:, HEADING] = (discontinuities[:, HEADING] + np.pi) % (2 * np.pi) - np.pi
    closing, by_values = np.zeros_like(initial_states), np.zeros((len(initial_states), n_states, n_values))
    by_values[0, :, :n_states] = np.eye(n_states)
    for i, discontinuity in enumerate(discontinuities):
        closing[i + 1] = batch.ends_by_start[i] @ closing[i] + discontinuity
        by_values[i + 1] = batch.ends_by_start[i] @ by_values[i]
        by_values[i + 1, :, n_states:] += batch.ends_by_effects[i]
    weight = observations.per_sigma
    residual = observations.residual_sigma(batch.force_g)
    jacobian = np.empty((len(residual), 3, n_values))
    for i, (first, last) in enumerate(pairwise([*first_samples, len(residual)])):
        by_state = batch.force_by_start[first:last].reshape(-1, n_states)  # one matrix product for all samples
        jacobian[first:last] = (by_state @ by_values[i]).reshape(-1, 3, n_values)
        residual[first:last] -= (by_state @ closing[i]).reshape(-1, 3) * weight[first:last]
    jacobian[..., n_states:] += batch.force_by_effects
    jacobian *= weight[..., None]
    return CondensedSystem(residual, jacobian, closing, by_values, float(np.abs(discontinuities).max(initial=0.0)))
