"""A simulator in the coordinates of a fit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.fit.modal_parameterisation import HOOK_MASS_RATIO, ModalParameterisation
from gateway.twin.reconcile.fit.reparameterisation import InverseCutoffs, Reparameterisation
from gateway.twin.simulator.simulator import SegmentBatch, Simulator

Array = NDArray[np.float64]
Limits = Mapping[str, tuple[float, float]]
"""Lower and upper bounds of effect values by label, where a recording sets narrower ones than the effect."""
NO_LIMITS: Limits = {}


class ReparameterisedSimulator:
    """A simulator with changes of coordinates for its effect values; the initial state stays as it is."""

    def __init__(self, simulator: Simulator, changes: Sequence[Reparameterisation], limits: Limits) -> None:
        """No two changes are of the same effect value; `limits` replace the bounds of effect values that have no change."""
        self.simulator, self._changes = simulator, tuple(changes)
        lower = np.array([parameter.lower for parameter in simulator.effect_parameters])
        upper = np.array([parameter.upper for parameter in simulator.effect_parameters])
        for i, parameter in enumerate(simulator.effect_parameters):
            lower[i], upper[i] = limits.get(parameter.label, (lower[i], upper[i]))
        for change in changes:
            lower, upper = change.fitted_bounds(lower, upper)
        initial = simulator.parameters[: simulator.n_initial_states]
        self.lower = np.array([*(parameter.lower for parameter in initial), *lower])
        """Lower bounds of all values, shape (values,)."""
        self.upper = np.array([*(parameter.upper for parameter in initial), *upper])
        """Upper bounds of all values, shape (values,)."""
        self.step_limit = np.array([parameter.step_limit for parameter in simulator.parameters])
        """Largest step of each value, shape (values,)."""

    def to_fitted(self, effect_values: Array) -> Array:
        """Return the coordinates of the fit for effect values (k,)."""
        for change in self._changes:
            effect_values = change.to_fitted(effect_values)
        return effect_values

    def to_physical(self, fitted: Array) -> Array:
        """Return the effect values for coordinates of the fit (k,)."""
        for change in reversed(self._changes):
            fitted = change.to_physical(fitted)
        return fitted

    def physical_by_fitted(self, fitted: Array) -> Array:
        """Return the derivatives of the effect values by the coordinates of the fit, shape (k, k)."""
        by_fitted = np.eye(len(fitted))
        for change in self._changes:
            by_fitted = by_fitted @ change.physical_by_fitted(fitted)
        return by_fitted

    def predict(self, initial_state: Array, fitted: Array, time_s: Array, temperature_c: Array | None = None) -> Array:
        """Return the samples in g, shape (n, 3), as `Simulator.predict` does."""
        return self.simulator.predict(np.concatenate([initial_state, self.to_physical(fitted)]), time_s, temperature_c)

    def linearise_segments(
        self,
        initial_states: Array,
        fitted: Array,
        time_s: Array,
        first_samples: Sequence[int],
        temperature_c: Array | None = None,
    ) -> SegmentBatch:
        """Return what `Simulator.linearise_segments` does, with derivatives by the coordinates of the fit."""
        batch = self.simulator.linearise_segments(
            initial_states, self.to_physical(fitted), time_s, first_samples, temperature_c
        )
        if not self._changes:
            return batch
        by_fitted = self.physical_by_fitted(fitted)
        return replace(
            batch,
            force_by_effects=batch.force_by_effects @ by_fitted,
            ends_by_effects=batch.ends_by_effects @ by_fitted,
        )

    def jacobian_by_physical(self, jacobian: Array, fitted: Array) -> Array:
        """Return a Jacobian (..., values) by the initial state and the effect values."""
        if not self._changes:
            return jacobian
        n_states = self.simulator.n_initial_states
        by_values = jacobian.copy()
        by_values[..., n_states:] = jacobian[..., n_states:] @ np.linalg.inv(self.physical_by_fitted(fitted))
        return by_values


def reparameterise(
    simulator: Simulator, free: NDArray[np.bool_], limits: Limits = NO_LIMITS
) -> ReparameterisedSimulator:
    """Return the simulator in the coordinates that suit the free ones of its values (values,)."""
    free_effect_values = [
        (i, parameter)
        for i, parameter in enumerate(simulator.effect_parameters)
        if free[simulator.n_initial_states + i]
    ]
    changes: list[Reparameterisation] = []
    cutoffs = [i for i, parameter in free_effect_values if parameter.is_cutoff]
    if cutoffs:
        changes.append(InverseCutoffs(cutoffs))
    if any(parameter.label == HOOK_MASS_RATIO for _, parameter in free_effect_values):
        changes.append(ModalParameterisation(simulator.rig, simulator.effect_parameters))
    return ReparameterisedSimulator(simulator, changes, limits)
