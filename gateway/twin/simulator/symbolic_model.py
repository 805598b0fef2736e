"""A model put together from effects: its equations as symbols."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from devices.pendulum import equations as eq
from devices.pendulum.equations import Scalar, Vector
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import BodyState, Effect, EvaluationContext, ModelStructure, RopeGeometry, Symbols
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.simulator.state import NOTHING, Expression, State, structure_of, vector


@dataclass(frozen=True, slots=True)
class RigSymbols:
    """What the equations take from the rig."""

    length_m: float
    position_m: float
    gravity_m_s2: float
    reference_temperature_c: float


@dataclass(frozen=True, slots=True)
class _Kinematics:
    """What the forces make of a state."""

    ropes: RopeGeometry
    pivot: Vector
    n_acceleration: Vector
    m_acceleration: Vector
    stretch_acceleration: Scalar


class SymbolicModel:
    """The equations of one structure; the effects' parameters are its symbols."""

    def __init__(self, beliefs: RigSymbols, names: Iterable[str]) -> None:
        """Take effects by their names; they act in the vocabulary's order. Raises `ValueError` as `structure_of`."""
        chosen = set(names)
        self.rig = beliefs
        self.structure = structure_of(EFFECTS[name] for name in sorted(chosen))
        self.effects: tuple[Effect, ...] = tuple(effect for name, effect in EFFECTS.items() if name in chosen)
        self.p, self._of = self._parameters()

    def _parameters(self) -> tuple[Expression, dict[str, Symbols]]:
        symbols: list[Expression] = [ca.SX(0, 1)]
        by_effect: dict[str, Symbols] = {}
        for effect in self.effects:
            named: dict[str, Any] = {}
            for parameter in effect.parameters:
                symbol = ca.SX.sym(f"{effect.name}.{parameter.name}", parameter.size)
                symbols.append(symbol)
                named[parameter.name] = tuple(ca.vertsplit(symbol)) if parameter.components else symbol
            by_effect[effect.name] = named
        return ca.vertcat(*symbols), by_effect

    def active_effects(self) -> list[tuple[Effect, Symbols]]:
        """Effects with their parameters' symbols."""
        return [(effect, self._of[effect.name]) for effect in self.effects]

    def context(self, time_s: Scalar, middle_s: Scalar, warmer_c: Scalar = 0.0) -> EvaluationContext:
        """An instant inside an integration step, on this rig."""
        return EvaluationContext(time_s, middle_s, self.rig.gravity_m_s2, warmer_c)

    # motion

    def rate(self, x: Expression, now: EvaluationContext) -> Expression:
        """x'."""
        state = State.of(x, self.structure)
        driven = self._kinematics(state, now)
        transported = eq.transport_rate(state.n, state.n_rate, state.x_axis)
        rates = State(state.n_rate, driven.n_acceleration, transported, state.m_rate, driven.m_acceleration)
        rates = replace(rates, stretch=state.stretch_rate, stretch_rate=driven.stretch_acceleration)
        return rates.column(self.structure)

    def apply_impulse(self, x: Expression, time_s: Expression, effect: Effect) -> Expression:
        """x after a blow: velocities jump as they would grow under a force, at rest and without weight."""
        blow = effect.velocity_jump_m_s(self._of[effect.name])
        if blow is None:
            raise ValueError(f"{effect.name} strikes no blow")
        state = State.of(x, self.structure)
        now = replace(self.context(time_s, time_s), stretch=(state.stretch, 0.0, 0.0))
        length = self._ropes(now).length[0]
        resting = replace(state, n_rate=NOTHING, m_rate=NOTHING)
        n_jump, m_jump = self._accelerations(resting, (length, 0.0, 0.0), NOTHING, blow)
        jump = State(NOTHING, n_jump, NOTHING, NOTHING, m_jump, 0.0, eq.dot(state.n, blow))
        return x + jump.column(self.structure)

    def edges(self) -> tuple[list[Expression], dict[int, Effect]]:
        """Times of all edges, since the recording's first sample, and at which of them which effect strikes."""
        times: list[Expression] = []
        kicks: dict[int, Effect] = {}
        for effect, p in self.active_effects():
            if effect.velocity_jump_m_s(p) is not None:
                kicks[len(times)] = effect
            times += effect.discontinuities_s(p)
        return times, kicks

    def _kinematics(self, state: State, now: EvaluationContext) -> _Kinematics:
        now = replace(now, stretch=(state.stretch, state.stretch_rate, 0.0))
        ropes, pivot = self._ropes(now), self._pivot(now)
        hook = eq.add((0.0, 0.0, -self.rig.gravity_m_s2), eq.scale(-1, pivot))
        load = eq.add(hook, self._force(now, self._load(state, ropes)))
        n_acceleration, m_acceleration = self._accelerations(state, ropes.length, hook, load)
        stretching = self._rope_elasticity(state, now, ropes, load)
        if self.structure is ModelStructure.ELASTIC:
            ropes = self._ropes(replace(now, stretch=(state.stretch, state.stretch_rate, stretching)))
        return _Kinematics(ropes, pivot, n_acceleration, m_acceleration, stretching)

    def _accelerations(
        self, state: State, length: tuple[Scalar, Scalar, Scalar], hook: Vector, load: Vector
    ) -> tuple[Vector, Vector]:
        """n'' and m'' under the drives of the hook and of the load."""
        if self.structure is not ModelStructure.RIGGING:
            return eq.acceleration_of_direction(state.n, state.n_rate, load, length[0], length[1]), NOTHING
        rigging = self._of[DoublePendulum.name]
        lengths = (length[0], rigging["rigging_length_m"])
        ropes = (state.n, state.n_rate, state.m, state.m_rate)
        return eq.accelerations_of_two(*ropes, hook, load, lengths, length[1], length[2], rigging["hook_mass_ratio"])

    def _rope_elasticity(self, state: State, now: EvaluationContext, ropes: RopeGeometry, load: Vector) -> Scalar:
        length, _, hoisting = ropes.length
        pull = length * eq.dot(state.n_rate, state.n_rate) + eq.dot(state.n, load) - hoisting
        beyond_rest: Scalar = pull - self.rig.gravity_m_s2
        acceleration: Scalar = 0.0
        for effect, p in self.active_effects():
            acceleration = acceleration + effect.stretch_m_s2(p, now, beyond_rest)
        return acceleration

    # sums over the effects

    def _ropes(self, now: EvaluationContext) -> RopeGeometry:
        ropes = RopeGeometry((self.rig.length_m, 0.0, 0.0), (self.rig.position_m, 0.0, 0.0))
        for effect, p in self.active_effects():
            ropes = effect.ropes(p, now, ropes)
        return ropes

    def _pivot(self, now: EvaluationContext) -> Vector:
        pivot = NOTHING
        for effect, p in self.active_effects():
            pivot = eq.add(pivot, effect.pivot_m_s2(p, now))
        return pivot

    def _force(self, now: EvaluationContext, load: BodyState) -> Vector:
        force = NOTHING
        for effect, p in self.active_effects():
            force = eq.add(force, effect.force_m_s2(p, now, load))
        return force

    def _load(self, state: State, ropes: RopeGeometry) -> BodyState:
        place, velocity = _on_rope(state, ropes.length)
        if self.structure is ModelStructure.RIGGING:
            rigging_m = self._of[DoublePendulum.name]["rigging_length_m"]
            place = eq.add(place, eq.scale(rigging_m, state.m))
            velocity = eq.add(velocity, eq.scale(rigging_m, state.m_rate))
        return BodyState(place, velocity, self._swing_rate)

    @property
    def _swing_rate(self) -> float:
        return small_swing_rate_1_s(self.rig.length_m, self.rig.gravity_m_s2)

    def _fictitious_acceleration(self, state: State, now: EvaluationContext, ropes: RopeGeometry) -> Vector:
        housing = BodyState(*_on_rope(state, ropes.position), self._swing_rate)
        felt = NOTHING
        for effect, p in self.active_effects():
            felt = eq.add(felt, effect.fictitious_acceleration_m_s2(p, now, housing))
        return felt

    # the sensor's chain

    def true_time(self, elapsed_s: Expression) -> Expression:
        """True time by recorded time, both since the recording's first sample."""
        for effect, p in self.active_effects():
            elapsed_s = effect.true_time_s(p, elapsed_s)
        return elapsed_s

    def reading(self, x: Expression, now: EvaluationContext) -> Expression:
        """Specific force in g as the sensor takes it up, before its low-pass."""
        state = State.of(x, self.structure)
        driven = self._kinematics(state, now)
        gravity = self.rig.gravity_m_s2
        force = eq.specific_force(
            state.n, state.n_rate, driven.n_acceleration, driven.pivot, gravity, *driven.ropes.position
        )
        force = eq.add(force, self._fictitious_acceleration(state, now, driven.ropes))
        reading = eq.scale(1 / gravity, self._in_housing_axes(eq.in_housing(state.n, state.x_axis, force), now))
        for effect, p in self.active_effects():
            reading = effect.reading_g(p, now, reading)
        return ca.vertcat(*reading)

    def _in_housing_axes(self, force: Vector, now: EvaluationContext) -> Vector:
        angle: Scalar = 0.0
        for effect, p in self.active_effects():
            angle = angle + effect.housing_rotation_rad(p, now)
        x, y, z = force
        return ca.cos(angle) * x + ca.sin(angle) * y, ca.cos(angle) * y - ca.sin(angle) * x, z

    def output(self, reading: Expression) -> Expression:
        """What the sensor hands on of a filtered reading."""
        handed = vector(reading, 0)
        for effect, p in self.active_effects():
            handed = effect.output_stage_g(p, handed)
        return ca.vertcat(*handed)


def _on_rope(state: State, distance: tuple[Scalar, Scalar, Scalar]) -> tuple[Vector, Vector]:
    """Place and velocity of what is on the rope."""
    velocity = eq.add(eq.scale(distance[0], state.n_rate), eq.scale(distance[1], state.n))
    return eq.scale(distance[0], state.n), velocity
