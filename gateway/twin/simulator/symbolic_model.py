"""A model put together from effects: its equations as symbols."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from devices.pendulum import equations as eq
from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Body, Effect, Moment, Ropes, Symbols
from gateway.twin.simulator.state import NOTHING, Expression, State, Structure, structure_of, vector


@dataclass(frozen=True, slots=True)
class Beliefs:
    """What the equations take from the rig."""

    length_m: float
    position_m: float
    gravity_m_s2: float
    reference_temperature_c: float


@dataclass(frozen=True, slots=True)
class _Driven:
    """What the forces make of a state."""

    ropes: Ropes
    pivot: Vector
    n_acceleration: Vector
    m_acceleration: Vector
    stretch_acceleration: Scalar


class Assembly:
    """The equations of one structure; the effects' parameters are its symbols."""

    def __init__(self, beliefs: Beliefs, names: Iterable[str]) -> None:
        """Take effects by their names; they act in the vocabulary's order. Raises `ValueError` as `structure_of`."""
        chosen = set(names)
        self.beliefs = beliefs
        self.structure = structure_of(chosen)
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

    def acting(self) -> list[tuple[Effect, Symbols]]:
        """Effects with their parameters' symbols."""
        return [(effect, self._of[effect.name]) for effect in self.effects]

    # motion

    def rate(self, x: Expression, now: Moment) -> Expression:
        """x'."""
        state = State.of(x, self.structure)
        driven = self._driven(state, now)
        transported = eq.transport_rate(state.n, state.n_rate, state.x_axis)
        rates = State(state.n_rate, driven.n_acceleration, transported, state.m_rate, driven.m_acceleration)
        rates = replace(rates, stretch=state.stretch_rate, stretch_rate=driven.stretch_acceleration)
        return rates.column(self.structure)

    def kicked(self, x: Expression, time_s: Expression, effect: Effect) -> Expression:
        """x after a blow: velocities jump as they would grow under a force, at rest and without weight."""
        blow = effect.kick(self._of[effect.name])
        if blow is None:
            raise ValueError(f"{effect.name} strikes no blow")
        state = State.of(x, self.structure)
        now = Moment(time_s, time_s, stretch=(state.stretch, 0.0, 0.0))
        length = self._ropes(now).length[0]
        resting = replace(state, n_rate=NOTHING, m_rate=NOTHING)
        n_jump, m_jump = self._accelerations(resting, (length, 0.0, 0.0), NOTHING, blow)
        jump = State(NOTHING, n_jump, NOTHING, NOTHING, m_jump, 0.0, eq.dot(state.n, blow))
        return x + jump.column(self.structure)

    def edges(self) -> tuple[list[Expression], dict[int, Effect]]:
        """Times of all edges, since the recording's first sample, and at which of them which effect strikes."""
        times: list[Expression] = []
        kicks: dict[int, Effect] = {}
        for effect, p in self.acting():
            if effect.kick(p) is not None:
                kicks[len(times)] = effect
            times += effect.edges(p)
        return times, kicks

    def _driven(self, state: State, now: Moment) -> _Driven:
        now = replace(now, stretch=(state.stretch, state.stretch_rate, 0.0))
        ropes, pivot = self._ropes(now), self._pivot(now)
        hook = eq.plus((0.0, 0.0, -self.beliefs.gravity_m_s2), eq.times(-1, pivot))
        load = eq.plus(hook, self._force(now, self._load(state, ropes)))
        n_acceleration, m_acceleration = self._accelerations(state, ropes.length, hook, load)
        stretching = self._stretching(state, now, ropes, load)
        if self.structure is Structure.ELASTIC:
            ropes = self._ropes(replace(now, stretch=(state.stretch, state.stretch_rate, stretching)))
        return _Driven(ropes, pivot, n_acceleration, m_acceleration, stretching)

    def _accelerations(
        self, state: State, length: tuple[Scalar, Scalar, Scalar], hook: Vector, load: Vector
    ) -> tuple[Vector, Vector]:
        """n'' and m'' under the drives of the hook and of the load."""
        if self.structure is not Structure.RIGGING:
            return eq.acceleration_of_direction(state.n, state.n_rate, load, length[0], length[1]), NOTHING
        rigging = self._of["double_pendulum"]
        lengths = (length[0], rigging["rigging_length_m"])
        ropes = (state.n, state.n_rate, state.m, state.m_rate)
        return eq.accelerations_of_two(*ropes, hook, load, lengths, length[1], length[2], rigging["hook_mass_ratio"])

    def _stretching(self, state: State, now: Moment, ropes: Ropes, load: Vector) -> Scalar:
        length, _, hoisting = ropes.length
        pull = length * eq.dot(state.n_rate, state.n_rate) + eq.dot(state.n, load) - hoisting
        beyond_rest: Scalar = pull - self.beliefs.gravity_m_s2
        acceleration: Scalar = 0.0
        for effect, p in self.acting():
            acceleration = acceleration + effect.stretch_m_s2(p, now, beyond_rest)
        return acceleration

    # sums over the effects

    def _ropes(self, now: Moment) -> Ropes:
        ropes = Ropes((self.beliefs.length_m, 0.0, 0.0), (self.beliefs.position_m, 0.0, 0.0))
        for effect, p in self.acting():
            ropes = effect.ropes(p, now, ropes)
        return ropes

    def _pivot(self, now: Moment) -> Vector:
        pivot = NOTHING
        for effect, p in self.acting():
            pivot = eq.plus(pivot, effect.pivot_m_s2(p, now))
        return pivot

    def _force(self, now: Moment, load: Body) -> Vector:
        force = NOTHING
        for effect, p in self.acting():
            force = eq.plus(force, effect.force_m_s2(p, now, load))
        return force

    def _load(self, state: State, ropes: Ropes) -> Body:
        place, velocity = _on_rope(state, ropes.length)
        if self.structure is Structure.RIGGING:
            rigging_m = self._of["double_pendulum"]["rigging_length_m"]
            place = eq.plus(place, eq.times(rigging_m, state.m))
            velocity = eq.plus(velocity, eq.times(rigging_m, state.m_rate))
        return Body(place, velocity, self._swing_rate)

    @property
    def _swing_rate(self) -> float:
        return math.sqrt(self.beliefs.gravity_m_s2 / self.beliefs.length_m)

    def _felt(self, state: State, now: Moment, ropes: Ropes) -> Vector:
        housing = Body(*_on_rope(state, ropes.position), self._swing_rate)
        felt = NOTHING
        for effect, p in self.acting():
            felt = eq.plus(felt, effect.felt_m_s2(p, now, housing))
        return felt

    # the sensor's chain

    def true_time(self, elapsed_s: Expression) -> Expression:
        """True time by recorded time, both since the recording's first sample."""
        for effect, p in self.acting():
            elapsed_s = effect.true_time_s(p, elapsed_s)
        return elapsed_s

    def reading(self, x: Expression, now: Moment) -> Expression:
        """Specific force in g as the sensor takes it up, before its low-pass."""
        state = State.of(x, self.structure)
        driven = self._driven(state, now)
        gravity = self.beliefs.gravity_m_s2
        force = eq.specific_force(
            state.n, state.n_rate, driven.n_acceleration, driven.pivot, gravity, *driven.ropes.position
        )
        force = eq.plus(force, self._felt(state, now, driven.ropes))
        reading = eq.times(1 / gravity, self._turned(eq.in_housing(state.n, state.x_axis, force), now))
        for effect, p in self.acting():
            reading = effect.reading_g(p, now, reading)
        return ca.vertcat(*reading)

    def _turned(self, force: Vector, now: Moment) -> Vector:
        angle: Scalar = 0.0
        for effect, p in self.acting():
            angle = angle + effect.turn_rad(p, now)
        x, y, z = force
        return ca.cos(angle) * x + ca.sin(angle) * y, ca.cos(angle) * y - ca.sin(angle) * x, z

    def output(self, reading: Expression) -> Expression:
        """What the sensor hands on of a filtered reading."""
        handed = vector(reading, 0)
        for effect, p in self.acting():
            handed = effect.output_g(p, handed)
        return ca.vertcat(*handed)


def _on_rope(state: State, distance: tuple[Scalar, Scalar, Scalar]) -> tuple[Vector, Vector]:
    """Place and velocity of what is on the rope."""
    velocity = eq.plus(eq.times(distance[0], state.n_rate), eq.times(distance[1], state.n))
    return eq.times(distance[0], state.n), velocity
