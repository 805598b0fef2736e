"""A double pendulum by its rigging and its fast mode's frequency instead of its hook's mass: what a fit goes straight by.

The readings tell the frequency to a part in a million, so rigging and mass make up for each other in a narrow valley, which is
curved in them and straight in these.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import hook_mass_ratio, hook_mass_ratio_slopes, modes
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.simulator.simulator import SegmentBatch, Simulator

Array = NDArray[np.float64]
FAST_HZ = (0.01, 20.0)


class ModalSimulator(Simulator):
    """A simulator of a double pendulum that is run by the fast mode's frequency in the place of the hook's mass.

    `values` and `effects` are as a simulator's; `by_mode` and `by_mass` lead to these coordinates and back.
    """

    def __init__(self, rig: TwinRig, effect_names: Sequence[str]) -> None:
        """Raises `ValueError` as a simulator does, and without `double_pendulum`."""
        super().__init__(rig, effect_names)
        labels = [slot.label for slot in self.parameters]
        self._rigging = labels.index(f"{DoublePendulum.name}.rigging_length_m")
        self._mass = labels.index(f"{DoublePendulum.name}.hook_mass_ratio")
        slots, place = list(self.parameters), self._mass
        self._least, self._most = slots[place].lower, slots[place].upper
        slots[place] = replace(slots[place], unit="Hz", lower=FAST_HZ[0], upper=FAST_HZ[1])
        self.parameters = tuple(slots)
        self.of_effects = self.parameters[self.n_initial_states :]

    def to_modal(self, values: Array) -> Array:
        """A simulator's values in these coordinates; all values or those of the effects alone."""
        rigging, mass = self._places(values)
        found, upper_m = values.copy(), self.rig.length_m - values[rigging]
        _, fast = modes(upper_m, values[rigging], values[mass], self.rig.gravity_m_s2)
        found[mass] = fast.rate / (2 * np.pi)
        return found

    def to_physical(self, values: Array) -> Array:
        """And back."""
        rigging, mass = self._places(values)
        found = values.copy()
        upper_m, rate_1_s = self.rig.length_m - values[rigging], 2 * np.pi * values[mass]
        ratio = hook_mass_ratio(upper_m, values[rigging], rate_1_s, self.rig.gravity_m_s2)
        found[mass] = np.clip(ratio, self._least, self._most)
        return found

    def predict(self, values: Array, time_s: Array, temperature_c: Array | None = None) -> Array:
        """As a simulator does."""
        return super().predict(self.to_physical(values), time_s, temperature_c)

    def linearise_segments(
        self,
        starts: Array,
        effects: Array,
        time_s: Array,
        firsts: Sequence[int],
        temperature_c: Array | None = None,
    ) -> SegmentBatch:
        """As a simulator does; derivatives are by these coordinates."""
        found = super().linearise_segments(starts, self.to_physical(effects), time_s, firsts, temperature_c)
        by = self._mass_by(effects)
        return replace(found, force_by_effects=found.force_by_effects @ by, ends_by_effects=found.ends_by_effects @ by)

    def fit_by_mass(self, fit: Fit) -> Fit:
        """A fit in these coordinates, in a simulator's."""
        by = np.eye(len(fit.values))
        by[self.n_initial_states :, self.n_initial_states :] = np.linalg.inv(
            self._mass_by(fit.values[self.n_initial_states :])
        )
        jacobian = fit.jacobian @ by
        flat = jacobian[..., fit.free].reshape(-1, int(fit.free.sum()))
        return replace(fit, values=self.to_physical(fit.values), jacobian=jacobian, normal=flat.T @ flat)

    def _places(self, values: Array) -> tuple[int, int]:
        less = len(self.parameters) - len(values)
        return self._rigging - less, self._mass - less

    def _mass_by(self, effects: Array) -> Array:
        """Effects' values by these coordinates, shape (effect values, effect values)."""
        rigging, mass = self._places(effects)
        upper_m, rate_1_s = self.rig.length_m - effects[rigging], 2 * np.pi * effects[mass]
        by_rigging, by_rate = hook_mass_ratio_slopes(upper_m, effects[rigging], rate_1_s, self.rig.gravity_m_s2)
        by = np.eye(len(effects))
        by[mass, rigging], by[mass, mass] = by_rigging, 2 * np.pi * by_rate
        return by
