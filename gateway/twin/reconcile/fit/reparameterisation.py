"""Changes of coordinates in which a fit converges in fewer steps, and a simulator in these coordinates."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import hook_mass_ratio, hook_mass_ratio_slopes, modes
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import TwinRig
from gateway.twin.simulator.parameter_vector import ParameterSpec
from gateway.twin.simulator.simulator import SegmentBatch, Simulator

Array = NDArray[np.float64]
RIGGING_LENGTH, HOOK_MASS_RATIO = f"{DoublePendulum.name}.rigging_length_m", f"{DoublePendulum.name}.hook_mass_ratio"
"""Labels of the two parameters."""
FAST_MODE_BOUNDS_HZ = (0.01, 20.0)
"""Bounds of the fast mode's frequency; wider than any rig's, so that the bounds of the hook's mass decide."""
Limits = Mapping[str, tuple[float, float]]
"""Lower and upper bounds of effect values by label, where a recording sets narrower ones than the effect."""
NO_LIMITS: Limits = {}


class InverseCutoffs:
    """Cutoff frequencies by their inverse, a delay, for which the initial state compensates in proportion."""

    def __init__(self, positions: Sequence[int]) -> None:
        """`positions` are those of the cutoffs among the effect values."""
        self._positions = list(positions)

    def to_fitted(self, effect_values: Array) -> Array:
        """Return the values with each cutoff replaced by its inverse."""
        fitted = effect_values.copy()
        fitted[self._positions] = 1 / effect_values[self._positions]
        return fitted

    def to_physical(self, fitted: Array) -> Array:
        """Return the effect values."""
        return self.to_fitted(fitted)

    def physical_by_fitted(self, fitted: Array) -> Array:
        """Return the derivatives: -f^2 for a cutoff f."""
        diagonal = np.ones_like(fitted)
        diagonal[self._positions] = -1 / fitted[self._positions] ** 2
        return np.diag(diagonal)

    def fitted_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the bounds; the inverse of an upper bound is a lower one."""
        fitted_lower, fitted_upper = lower.copy(), upper.copy()
        fitted_lower[self._positions] = 1 / upper[self._positions]
        fitted_upper[self._positions] = 1 / lower[self._positions]
        return fitted_lower, fitted_upper


class ModalParameterisation:
    """The frequency of the fast mode in place of the hook's mass ratio.

    The samples determine the frequency to a part in a million. In rigging length and mass the minimum is therefore a narrow,
    curved valley; in rigging length and frequency it is straight.
    """

    def __init__(self, rig: TwinRig, effect_parameters: Sequence[ParameterSpec]) -> None:
        """Raises `ValueError` where the parameters are not those of a model with a double pendulum."""
        labels = [parameter.label for parameter in effect_parameters]
        self._rig, self._rigging, self._mass = rig, labels.index(RIGGING_LENGTH), labels.index(HOOK_MASS_RATIO)
        self._mass_bounds = effect_parameters[self._mass].lower, effect_parameters[self._mass].upper

    def to_fitted(self, effect_values: Array) -> Array:
        """Return the values with the fast mode's frequency, Hz, in place of the hook's mass ratio."""
        fitted, rigging_m = effect_values.copy(), effect_values[self._rigging]
        _, fast = modes(self._rig.length_m - rigging_m, rigging_m, effect_values[self._mass], self._rig.gravity_m_s2)
        fitted[self._mass] = fast.rate / (2 * np.pi)
        return fitted

    def to_physical(self, fitted: Array) -> Array:
        """Return the effect values, the hook's mass ratio inside its bounds."""
        physical = fitted.copy()
        physical[self._mass] = np.clip(hook_mass_ratio(*self._lengths_rate_gravity(fitted)), *self._mass_bounds)
        return physical

    def physical_by_fitted(self, fitted: Array) -> Array:
        """Return the derivatives of the effect values by the coordinates of the fit."""
        by_rigging, by_rate = hook_mass_ratio_slopes(*self._lengths_rate_gravity(fitted))
        by_fitted = np.eye(len(fitted))
        by_fitted[self._mass, self._rigging], by_fitted[self._mass, self._mass] = by_rigging, 2 * np.pi * by_rate
        return by_fitted

    def fitted_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the bounds, with those of the frequency."""
        fitted_lower, fitted_upper = lower.copy(), upper.copy()
        fitted_lower[self._mass], fitted_upper[self._mass] = FAST_MODE_BOUNDS_HZ
        return fitted_lower, fitted_upper

    def _lengths_rate_gravity(self, fitted: Array) -> tuple[float, float, float, float]:
        """Return the lengths of rope and rigging, the angular frequency of the fast mode, and gravity, in SI units."""
        rigging_m, fast_rate_1_s = float(fitted[self._rigging]), 2 * np.pi * float(fitted[self._mass])
        return self._rig.length_m - rigging_m, rigging_m, fast_rate_1_s, self._rig.gravity_m_s2


Reparameterisation = InverseCutoffs | ModalParameterisation
"""An invertible change from the effect values (k,) of a simulator to the coordinates of a fit."""


class ReparameterisedSimulator:
    """A simulator with changes of coordinates for its effect values; the initial state stays as it is."""

    def __init__(self, simulator: Simulator, changes: Sequence[Reparameterisation], limits: Limits) -> None:
        """No two changes are of the same effect value; `limits` replace the bounds of effect values that have no change."""
        self.simulator, self._changes = simulator, tuple(changes)
        lower, upper = effect_bounds(simulator, limits)
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


def effect_bounds(simulator: Simulator, limits: Limits) -> tuple[Array, Array]:
    """Return the lower and upper bounds of the effect values, shape (k,) each."""
    bounds = [limits.get(each.label, (each.lower, each.upper)) for each in simulator.effect_parameters]
    lower, upper = np.array(bounds, dtype=np.float64).reshape(-1, 2).T
    return lower, upper


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
