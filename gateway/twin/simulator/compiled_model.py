"""Compiled functions of a symbolic model with their exact derivatives, and the integration step: arrays in, arrays out.

The step is an explicit Runge-Kutta method of order six in seven stages (Butcher 1964; Hairer et al. 1993, II.5).
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.twin.effects.effect import Effect
from gateway.twin.simulator.state import (
    Expression,
    initial_from_state,
    initial_state_specs,
    on_constraints,
    state_from_initial,
    state_size,
)
from gateway.twin.simulator.symbolic_model import NominalRig, SymbolicModel
from gateway.twin.simulator.vectorised_function import VectorisedFunction, VectorisedJacobian

NODES = (0.0, 1 / 3, 2 / 3, 1 / 3, 1 / 2, 1 / 2, 1.0)
"""Time of each stage, as a part of the step (Butcher 1964)."""
STAGES = (
    (),
    (1 / 3,),
    (0.0, 2 / 3),
    (1 / 12, 1 / 3, -1 / 12),
    (-1 / 16, 9 / 8, -3 / 16, -3 / 8),
    (0.0, 9 / 8, -3 / 8, -3 / 4, 1 / 2),
    (9 / 44, -9 / 11, 63 / 44, 18 / 11, 0.0, -16 / 11),
)
"""Weights of the earlier rates in the state of each stage (Butcher 1964)."""
WEIGHTS = (11 / 120, 0.0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120)
"""Weights of the rates in the state at the end of the step (Butcher 1964)."""


def runge_kutta_step(
    rate: Callable[[Expression, Expression], Expression], state: Expression, time_s: Expression, step_s: Expression
) -> Expression:
    """Return the state after a step, for `rate(state, time_s)`."""
    rates: list[Expression] = []
    for node, weights in zip(NODES, STAGES, strict=True):
        rates.append(rate(_moved(state, step_s, weights, rates), time_s + node * step_s))
    return _moved(state, step_s, WEIGHTS, rates)


def _moved(state: Expression, step_s: Expression, weights: tuple[float, ...], rates: list[Expression]) -> Expression:
    terms = [weight * each for weight, each in zip(weights, rates, strict=True) if weight]
    return state + step_s * sum(terms) if terms else state


Array = NDArray[np.float64]
MAX_PHASE_STEP_RAD = 0.12
"""Phase of the swing in one integration step. Basis: at 80 degrees the error adds up to 2e-5 rad in 36 periods, and interpolation
inside the step is good to 1e-6 rad."""
MAX_STEP_S = 0.1
"""Longest integration step."""
STEPS_PER_OCTAVE = 4
"""Step lengths per octave. Basis: small changes of the parameters keep the grid."""
CACHED_MODELS = 64
"""Compiled models that are kept."""


class IntegrationError(ValueError):
    """Parameters under which the integration fails."""


INTEGRATION_FAILURES = (np.linalg.LinAlgError, FloatingPointError, IntegrationError)
"""Exceptions of a fit that runs to such parameters."""


@lru_cache(maxsize=CACHED_MODELS)
def compile_model(rig: NominalRig, effects: tuple[Effect, ...]) -> "CompiledModel":
    """Return the model of a rig and effects, compiled once."""
    return CompiledModel(SymbolicModel(rig, effects))


class CompiledModel:
    """All functions that a simulator needs for one set of effects; each is compiled when it is first used."""

    def __init__(self, model: SymbolicModel) -> None:
        self.symbolic = model
        self.structure = model.structure
        self._p = model.p
        self._x = ca.SX.sym("x", state_size(self.structure))
        self._t, self._h, self._middle = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("middle")
        self._recorded, self._temperature_c = ca.SX.sym("recorded"), ca.SX.sym("temperature")
        self._reading = ca.SX.sym("reading", 3)

    def step_s(self, p: Array) -> float:
        """Return the longest integration step at parameters p. Raises `IntegrationError`."""
        rig = self.symbolic.rig
        swing_s = MAX_PHASE_STEP_RAD / small_swing_rate_1_s(rig.length_m, rig.gravity_m_s2)
        limit_s = float(np.min([swing_s, *self._step_limits(p).full()[:, 0]]))
        if not (limit_s > 0 and np.isfinite(p).all()):
            raise IntegrationError("no integration can follow these parameters; keep them inside their bounds")
        exponent = math.ceil(STEPS_PER_OCTAVE * math.log2(MAX_STEP_S / limit_s))
        return float(MAX_STEP_S * 2 ** (-exponent / STEPS_PER_OCTAVE))

    @cached_property
    def _step_limits(self) -> Any:
        rig = self.symbolic.rig
        limits = [
            effect.longest_step_s(p, rig.length_m, rig.gravity_m_s2) for effect, p in self.symbolic.active_effects()
        ]
        return ca.Function("step_limits", [self._p], [ca.vertcat(MAX_STEP_S, *limits)])

    @cached_property
    def state(self) -> Any:
        """The state x of an initial state z, and its derivatives by z."""
        z = ca.SX.sym("z", len(initial_state_specs(self.structure)))
        state = state_from_initial(z, self.structure)
        return ca.Function("state", [z], [state, ca.jacobian(state, z)])

    @cached_property
    def initial_state(self) -> Any:
        """The initial state z of a state x, and its derivatives by x."""
        initial = initial_from_state(self._x, self.structure)
        return ca.Function("initial_state", [self._x], [initial, ca.jacobian(initial, self._x)])

    @cached_property
    def discontinuities(self) -> Any:
        """The times of all discontinuities, and their derivatives by p."""
        times = ca.vertcat(ca.SX(0, 1), *self.symbolic.discontinuities()[0])
        return ca.Function("discontinuities", [self._p], [times, ca.jacobian(times, self._p)])

    @cached_property
    def impulses(self) -> dict[int, Any]:
        """By the index of its discontinuity: the state after an impulse, as a function of (x, time, p), with its derivatives."""
        found = {}
        for index, effect in self.symbolic.discontinuities()[1].items():
            after = self.symbolic.apply_impulse(self._x, self._t, effect)
            by = [ca.jacobian(after, each) for each in (self._x, self._p, self._t)]
            found[index] = ca.Function(f"impulse_{effect.name}", [self._x, self._t, self._p], [after, *by])
        return found

    @cached_property
    def true_time(self) -> VectorisedFunction:
        """The true time of a recorded time, both since the first sample; its derivatives are those by p alone."""
        return VectorisedFunction([self._recorded], self._p, self.symbolic.true_time(self._recorded), self._p)

    def steps(self, state: Array, time_s: Array, step_s: Array, p: Array) -> Array:
        """Return the states at the ends of n steps, shape (n, states)."""
        # CasADi reads and writes these arrays themselves; converting them would take as long as the step.
        begin, time_and_length, end = state.copy(), np.empty(2), np.empty(len(state))
        step, compute = self._step.buffer()
        for place, given in enumerate((begin, time_and_length, np.ascontiguousarray(p))):
            step.set_arg(place, given.data)
        step.set_res(0, end.data)
        states = np.empty((len(time_s), len(state)))
        for i, instant in enumerate(zip(time_s.tolist(), step_s.tolist(), strict=True)):
            time_and_length[:] = instant
            compute()
            states[i] = begin[:] = end
        return states

    @cached_property
    def rate(self) -> VectorisedFunction:
        """The derivative of the state by time, a function of (x, time, middle of the step)."""
        return VectorisedFunction(self._rate_inputs, self._p, self._rate)

    @property
    def _rate_inputs(self) -> Sequence[Expression]:
        return [self._x, self._t, self._middle]

    @cached_property
    def _rate(self) -> Expression:
        return self.symbolic.rate(self._x, self.symbolic.context(self._t, self._middle))

    @cached_property
    def _rate_function(self) -> Any:
        # A step inserts it four times, which is quicker than building the equations four times.
        return ca.Function("rate", [*self._rate_inputs, self._p], [self._rate])

    @cached_property
    def constraint_jacobian(self) -> VectorisedJacobian:
        """The derivatives of a state on its constraints by the state x that has left them."""
        return VectorisedJacobian([self._x], self._p, on_constraints(self._x, self.structure), self._x)

    @cached_property
    def _step(self) -> Any:
        """The state at the end of a step, a function of (x, [time, length], p)."""
        middle = self._t + self._h / 2

        def rate(state: Expression, time_s: Expression) -> Expression:
            return self._rate_function(state, time_s, middle, self._p)

        end = on_constraints(runge_kutta_step(rate, self._x, self._t, self._h), self.structure)
        return ca.Function("step", [self._x, ca.vertcat(self._t, self._h), self._p], [end], {"cse": True})

    @cached_property
    def reading(self) -> VectorisedFunction:
        """The reading before the low-pass, a function of x, the recorded time, the middle of the step and the temperature."""
        true = self.symbolic.true_time(self._recorded)
        temperature_rise_c = self._temperature_c - self.symbolic.rig.reference_temperature_c
        reading = self.symbolic.reading(self._x, self.symbolic.context(true, self._middle, temperature_rise_c))
        return VectorisedFunction([self._x, self._recorded, self._middle, self._temperature_c], self._p, reading)

    @cached_property
    def output(self) -> VectorisedFunction:
        """The sensor's output for a reading after the low-pass."""
        return VectorisedFunction([self._reading], self._p, self.symbolic.output(self._reading))
