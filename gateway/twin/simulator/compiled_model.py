"""Compiled functions of an assembly, with their exact derivatives; arrays in, arrays out."""

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.twin.effects.effect import Effect
from gateway.twin.simulator.state import Expression, initial_from_state, state_from_initial
from gateway.twin.simulator.symbolic_model import RigSymbols, SymbolicModel
from gateway.twin.simulator.vectorised_function import VectorisedFunction, VectorisedJacobian

Array = NDArray[np.float64]
STEPS_AT_ONCE = 64
MAX_PHASE_STEP_RAD = 0.06
"""What a swing turns through in one step: the error of its phase is then some 1e-7 of it."""
MAX_STEP_S = 0.1
STEPS_PER_OCTAVE = 4


@lru_cache(maxsize=64)
def compile_model(beliefs: RigSymbols, names: frozenset[str]) -> "CompiledModel":
    """Compiled once for each structure and rig."""
    return CompiledModel(SymbolicModel(beliefs, names))


class IntegrationError(ValueError):
    """Parameters that no integration can follow."""


INTEGRATION_FAILURES = (np.linalg.LinAlgError, FloatingPointError, IntegrationError)
"""What is raised where a fit runs to such parameters."""


class CompiledModel:
    """All functions that a simulator needs, for one structure of the model; each is made when it is first used."""

    def __init__(self, assembly: SymbolicModel) -> None:
        self.assembly = assembly
        self.structure = assembly.structure
        self._p = assembly.p
        self._x = ca.SX.sym("x", self.structure.n_states)
        self._end = ca.SX.sym("end", self.structure.n_states)
        self._t, self._h = ca.SX.sym("t"), ca.SX.sym("h")
        self._elapsed, self._temperature_c = ca.SX.sym("elapsed"), ca.SX.sym("temperature")
        self._reading = ca.SX.sym("reading", 3)

    def step_s(self, p: Array) -> float:
        """The longest step at parameters p; on a ladder, so that small changes of them keep the grid."""
        beliefs = self.assembly.rig
        swing_s = MAX_PHASE_STEP_RAD / small_swing_rate_1_s(beliefs.length_m, beliefs.gravity_m_s2)
        wanted_s = float(np.min([swing_s, *self._step_limits(p).full()[:, 0]]))
        if not (wanted_s > 0 and np.isfinite(p).all()):
            raise IntegrationError("no integration can follow these parameters; keep them inside their bounds")
        rungs = math.ceil(STEPS_PER_OCTAVE * math.log2(MAX_STEP_S / wanted_s))
        return float(MAX_STEP_S * 2 ** (-rungs / STEPS_PER_OCTAVE))

    @cached_property
    def _step_limits(self) -> Any:
        rig = self.assembly.rig
        active = self.assembly.active_effects()
        limits = [effect.longest_step_s(p, rig.length_m, rig.gravity_m_s2) for effect, p in active]
        return ca.Function("step_limits", [self._p], [ca.vertcat(MAX_STEP_S, *limits)])

    @cached_property
    def state(self) -> Any:
        """x and its derivatives by z, of z."""
        z = ca.SX.sym("z", self.structure.n_initial_states)
        state = state_from_initial(z, self.structure)
        return ca.Function("state", [z], [state, ca.jacobian(state, z)])

    @cached_property
    def start(self) -> Any:
        """z and its derivatives by x, of x."""
        start = initial_from_state(self._x, self.structure)
        return ca.Function("start", [self._x], [start, ca.jacobian(start, self._x)])

    @cached_property
    def edges(self) -> Any:
        """Times of all edges, and their derivatives by p."""
        edges = ca.vertcat(ca.SX(0, 1), *self.assembly.edges()[0])
        return ca.Function("edges", [self._p], [edges, ca.jacobian(edges, self._p)])

    @cached_property
    def velocity_jumps(self) -> dict[int, Any]:
        """By its edge: x after a blow of (x, time, p), and its derivatives by x, by p, by time."""
        return {edge: self._kick(effect) for edge, effect in self.assembly.edges()[1].items()}

    def _kick(self, effect: Effect) -> Any:
        kicked = self.assembly.apply_impulse(self._x, self._t, effect)
        by = [ca.jacobian(kicked, each) for each in (self._x, self._p, self._t)]
        return ca.Function(f"kick_{effect.name}", [self._x, self._t, self._p], [kicked, *by])

    @cached_property
    def true_time(self) -> VectorisedFunction:
        """Of recorded times, both since the first sample."""
        return VectorisedFunction([self._elapsed], self._p, self.assembly.true_time(self._elapsed))

    @cached_property
    def true_time_by_p(self) -> VectorisedJacobian:
        """Of recorded times."""
        return VectorisedJacobian([self._elapsed], self._p, self.assembly.true_time(self._elapsed), self._p)

    def steps(self, state: Array, time_s: Array, step_s: Array, p: Array) -> Array:
        """States at the ends of n steps, shape (n, states)."""
        count = len(time_s)
        many = np.zeros((2, -(-count // STEPS_AT_ONCE) * STEPS_AT_ONCE))
        many[0, :count], many[1, :count] = time_s, step_s
        repeated = np.repeat(p[:, None], STEPS_AT_ONCE, axis=1)
        found = []
        for first in range(0, count, STEPS_AT_ONCE):
            ends = self._many_steps(state, many[:, first : first + STEPS_AT_ONCE], repeated).full()
            found.append(ends.T)
            state = ends[:, -1]
        return np.concatenate(found)[:count]

    @cached_property
    def _many_steps(self) -> Any:
        inputs = [self._x, ca.vertcat(self._t, self._h), self._p]
        return ca.Function("step", inputs, [self._rk4_step], {"cse": True}).mapaccum("steps", STEPS_AT_ONCE)

    @cached_property
    def step_jacobian(self) -> VectorisedJacobian:
        """Of the state after a step of (x, time, length) by x, time, length and p."""
        by = ca.vertcat(self._x, self._t, self._h, self._p)
        return VectorisedJacobian([self._x, self._t, self._h], self._p, self._rk4_step, by)

    @cached_property
    def _rk4_step(self) -> Expression:
        """One classical Runge-Kutta step."""
        x, t, h = self._x, self._t, self._h
        middle = t + h / 2

        def rate(state: Expression, time_s: Expression) -> Expression:
            return self.assembly.rate(state, self.assembly.context(time_s, middle))

        k1 = rate(x, t)
        k2 = rate(x + h / 2 * k1, middle)
        k3 = rate(x + h / 2 * k2, middle)
        k4 = rate(x + h * k3, t + h)
        return x + h / 6 * (k1 + 2 * (k2 + k3) + k4)

    @cached_property
    def reading(self) -> VectorisedFunction:
        """Before the low-pass, of (x at the begin and the end of the step, its time, its length, recorded time, temperature)."""
        return VectorisedFunction(self._sampled_by, self._p, self._sampled)

    @cached_property
    def reading_jacobian(self) -> VectorisedJacobian:
        """By x at the begin and the end of the step, its time, its length, and p."""
        by = ca.vertcat(self._x, self._end, self._t, self._h, self._p)
        return VectorisedJacobian(self._sampled_by, self._p, self._sampled, by)

    @property
    def _sampled_by(self) -> Sequence[Expression]:
        return [self._x, self._end, self._t, self._h, self._elapsed, self._temperature_c]

    @cached_property
    def _sampled(self) -> Expression:
        """The state inside a step is a cubic through its ends."""
        t, h, middle = self._t, self._h, self._t + self._h / 2
        true = self.assembly.true_time(self._elapsed)
        s, rise = (true - t) / h, self._end - self._x
        slope = h * self.assembly.rate(self._x, self.assembly.context(t, middle))
        end_slope = h * self.assembly.rate(self._end, self.assembly.context(t + h, middle))
        cubic = slope + end_slope - 2 * rise
        x = self._x + s * (slope + s * (rise - slope - cubic + s * cubic))
        warmer_c = self._temperature_c - self.assembly.rig.reference_temperature_c
        return self.assembly.reading(x, self.assembly.context(true, middle, warmer_c))

    @cached_property
    def output(self) -> VectorisedFunction:
        """Of a reading behind the low-pass."""
        return VectorisedFunction([self._reading], self._p, self.assembly.output(self._reading))

    @cached_property
    def output_jacobian(self) -> VectorisedJacobian:
        """By the reading and p."""
        by = ca.vertcat(self._reading, self._p)
        return VectorisedJacobian([self._reading], self._p, self.assembly.output(self._reading), by)
