"""A double pendulum by its rigging length and the frequency of its fast mode, instead of the mass of its hook."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import hook_mass_ratio, hook_mass_ratio_slopes, modes
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.fit.reparameterisation import Reparameterisation
from gateway.twin.simulator.parameter_vector import ParameterSpec

Array = NDArray[np.float64]
RIGGING_LENGTH, HOOK_MASS_RATIO = f"{DoublePendulum.name}.rigging_length_m", f"{DoublePendulum.name}.hook_mass_ratio"
"""Labels of the two parameters."""
FAST_MODE_BOUNDS_HZ = (0.01, 20.0)
"""Bounds of the fast mode's frequency; wider than any rig's, so that the bounds of the hook's mass decide."""


class ModalParameterisation(Reparameterisation):
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
