"""A double pendulum by its rigging and its fast mode's frequency instead of its hook's mass: what a fit goes straight by.

The readings tell the frequency to a part in a million, so rigging and mass make up for each other in a narrow valley, which is
curved in them and straight in these.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.modes import modes
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.simulator.simulator import SegmentBatch, Simulator

Array = NDArray[np.float64]
FAST_HZ = (0.01, 20.0)
LIGHTEST = 1e-9
"""Least load over hook that is reckoned with, where no hook is heavy enough for a mode that slow."""


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
        """And back: (1 + R)(g w^2 (1/L1 + 1/l) - g^2/(L1 l)) = w^4, R the load over the hook."""
        rigging, mass = self._places(values)
        found = values.copy()
        ratio = 1 / max(self._load(values[rigging], values[mass]) - 1, LIGHTEST)
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

    def _lengths(self, rigging_m: float) -> tuple[float, float]:
        upper_m = self.rig.length_m - rigging_m
        return 1 / upper_m + 1 / rigging_m, 1 / (upper_m * rigging_m)

    def _load(self, rigging_m: float, fast_hz: float) -> float:
        """1 + R."""
        (both, product), g, square = self._lengths(rigging_m), self.rig.gravity_m_s2, (2 * np.pi * fast_hz) ** 2
        return float(square**2 / max(g * square * both - g**2 * product, LIGHTEST))

    def _mass_by(self, effects: Array) -> Array:
        """Effects' values by these coordinates, shape (effect values, effect values)."""
        rigging, mass = self._places(effects)
        by = np.eye(len(effects))
        rigging_m, fast_hz = effects[rigging], effects[mass]
        (both, product), g, square = self._lengths(rigging_m), self.rig.gravity_m_s2, (2 * np.pi * fast_hz) ** 2
        load, upper_m = self._load(rigging_m, fast_hz), self.rig.length_m - rigging_m
        divisor = max(g * square * both - g**2 * product, LIGHTEST)
        both_by, product_by = 1 / upper_m**2 - 1 / rigging_m**2, product * (1 / upper_m - 1 / rigging_m)
        mass_by_load = -1 / max(load - 1, LIGHTEST) ** 2
        by[mass, rigging] = -mass_by_load * load / divisor * (g * square * both_by - g**2 * product_by)
        by[mass, mass] = mass_by_load * load * (4 / fast_hz - 2 * g * square * both / (divisor * fast_hz))
        return by
