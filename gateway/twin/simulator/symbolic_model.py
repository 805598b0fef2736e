"""The symbolic model: the equations of motion and of the sensor, assembled from effects."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, TypeVar

import casadi as ca

from devices.pendulum import equations as eq
from devices.pendulum.equations import Scalar, Vector, WithDerivatives
from devices.pendulum.heavy_rope import HeavyRope
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, BodyState, EvaluationContext, Rigging, RopeGeometry
from gateway.twin.effects.parameter import ParameterKind, Symbols
from gateway.twin.simulator.state import (
    Expression,
    HousingOnBentRope,
    Kinematics,
    State,
    on_straight_rope,
    state_size,
    structure_of,
    vector,
)

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class NominalRig:
    """The quantities of the rig in the equations."""

    length_m: float
    position_m: float
    is_placed_from_load: bool
    gravity_m_s2: float
    reference_temperature_c: float


class SymbolicModel:
    """The equations of one set of effects; the parameters of the effects are their symbols."""

    def __init__(self, rig: NominalRig, effects: Sequence[Effect]) -> None:
        """Assemble effects in the order in which they act. Raises `ValueError` as `structure_of` does."""
        self.rig = rig
        self.structure = structure_of(effects)
        self.effects = tuple(effects)
        self.p, self._symbols = self._make_symbols()

    def _make_symbols(self) -> tuple[Expression, dict[str, Symbols]]:
        symbols: list[Expression] = [ca.SX(0, 1)]
        by_effect: dict[str, Symbols] = {}
        for effect in self.effects:
            named: dict[str, Any] = {}
            for parameter in effect.parameters:
                symbol = ca.SX.sym(f"{effect.name}.{parameter.name}", parameter.size)
                symbols.append(symbol)
                given = 1 / symbol if parameter.kind is ParameterKind.CUTOFF else symbol
                named[parameter.name] = tuple(ca.vertsplit(given)) if parameter.components else given
            by_effect[effect.name] = named
        return ca.vertcat(*symbols), by_effect

    def active_effects(self) -> list[tuple[Effect, Symbols]]:
        """Return the effects with the symbols of their parameters."""
        return [(effect, self._symbols[effect.name]) for effect in self.effects]

    def context(self, time_s: Scalar, step_middle_s: Scalar, temperature_rise_c: Scalar = 0.0) -> EvaluationContext:
        """Return an instant of this rig."""
        return EvaluationContext(time_s, step_middle_s, self.rig.gravity_m_s2, temperature_rise_c)

    # motion

    def rate(self, x: Expression, context: EvaluationContext) -> Expression:
        """Return the derivative of the state x by time."""
        state = State.of(x, self.structure)
        kinematics = self._kinematics(state, context)
        x_axis_rate = eq.transport_rate(state.n, state.n_rate, state.x_axis)
        second = kinematics.second_acceleration
        rate = State(state.n_rate, kinematics.n_acceleration, x_axis_rate, state.m_rate, second)
        rate = replace(rate, stretch=state.stretch_rate, stretch_rate=kinematics.stretch_acceleration)
        if self.structure is ModelStructure.PRESLIDING:
            load = self._load(state, kinematics.geometry)
            rate = replace(rate, presliding=self._sum(lambda effect, p: effect.presliding_rate_rad_s(p, load)))
        if self.structure is ModelStructure.HEAVY_ROPE:
            turning = self._housing_on_bent_rope(state, kinematics).turning_rad_s
            x_axis_rate = eq.add(x_axis_rate, eq.scale(turning, eq.cross(state.n, state.x_axis)))
            turned = (eq.transport_rate(state.n, state.n_rate, each) for each in (state.bow, state.bow_rate))
            bow = tuple(eq.add(*each) for each in zip((state.bow_rate, second), turned, strict=True))
            rate = replace(rate, x_axis=x_axis_rate, bow=bow[0], bow_rate=bow[1])
        return rate.column(self.structure)

    def apply_impulse(self, x: Expression, time_s: Expression, effect: Effect) -> Expression:
        """Return the state after an impulse: the rates change in proportion to the accelerations under a force alone."""
        jump = effect.velocity_jump_m_s(self._symbols[effect.name])
        if jump is None:
            raise ValueError(f"{effect.name} has no impulse")
        state = State.of(x, self.structure)
        context = replace(self.context(time_s, time_s), stretch=(state.stretch, 0.0, 0.0))
        geometry = self._rope_geometry(context)
        geometry = replace(geometry, length=(geometry.length[0], 0.0, 0.0))
        at_rest = replace(state, n_rate=ZERO_VECTOR, m_rate=ZERO_VECTOR, bow_rate=ZERO_VECTOR)
        n_jump, second_jump = self._accelerations(at_rest, geometry, ZERO_VECTOR, jump)
        jumps = second_jump, 0.0, eq.dot(state.n, jump)
        change = State(ZERO_VECTOR, n_jump, ZERO_VECTOR, ZERO_VECTOR, *jumps, bow_rate=second_jump)
        return x + change.column(self.structure)

    def discontinuities(self) -> tuple[list[Expression], dict[int, Effect]]:
        """Return the times of all discontinuities, since the first sample, and the effects with an impulse by their index."""
        times: list[Expression] = []
        impulses: dict[int, Effect] = {}
        for effect, p in self.active_effects():
            if effect.velocity_jump_m_s(p) is not None:
                impulses[len(times)] = effect
            times += effect.discontinuities_s(p)
        return times, impulses

    def _kinematics(self, state: State, context: EvaluationContext) -> Kinematics:
        context = replace(context, stretch=(state.stretch, state.stretch_rate, 0.0))
        geometry = self._rope_geometry(context)
        pivot = self._sum(lambda effect, p: effect.pivot_acceleration_m_s2(p, context))
        hook = eq.add((0.0, 0.0, -self.rig.gravity_m_s2), eq.scale(-1, pivot))
        body = self._load(state, geometry)
        load = eq.add(hook, self._sum(lambda effect, p: effect.force_m_s2(p, context, body)))
        n_acceleration, second = self._accelerations(state, geometry, hook, load)
        compliance = self._pivot_compliance()
        if compliance is not None:
            pivot = eq.add(pivot, eq.horizontal_product(compliance, n_acceleration))
        stretching = self._stretch_acceleration(state, context, geometry, load)
        if self.structure is ModelStructure.ELASTIC:
            stretch = (state.stretch, state.stretch_rate, stretching)
            geometry = self._rope_geometry(replace(context, stretch=stretch))
        return Kinematics(geometry, pivot, hook, n_acceleration, second, stretching)

    def _accelerations(self, state: State, geometry: RopeGeometry, hook: Vector, load: Vector) -> tuple[Vector, Vector]:
        """Return n'' and m'', or that of the bow, for forces over mass on the hook and on the load, inertial ones included."""
        rigging = self._rigging()
        compliance = self._pivot_compliance()
        if compliance is not None:
            body = *geometry.length[:2], geometry.gyration_squared_m2
            on_spring = compliance, self.rig.gravity_m_s2
            return eq.acceleration_on_yielding_pivot(state.n, state.n_rate, load, *body, *on_spring), ZERO_VECTOR
        rope = self._heavy_rope(geometry)
        if rope is not None:
            force = eq.add(load, eq.scale(-1, hook))
            return rope.accelerations(state.n, state.n_rate, state.bow, state.bow_rate, hook, force)
        if rigging is None:
            length = geometry.oscillation_length
            return eq.acceleration_of_direction(state.n, state.n_rate, load, length[0], length[1]), ZERO_VECTOR
        length, rigging = geometry.length, rigging.with_load_inertia(geometry.gyration_squared_m2)
        lengths, directions = (length[0], rigging.length_m), (state.n, state.n_rate, state.m, state.m_rate)
        return eq.accelerations_of_two(*directions, hook, load, lengths, length[1], length[2], rigging.hook_mass_ratio)

    def _stretch_acceleration(
        self, state: State, context: EvaluationContext, geometry: RopeGeometry, load: Vector
    ) -> Scalar:
        length, _, length_acceleration = geometry.length
        pull = length * eq.dot(state.n_rate, state.n_rate) + eq.dot(state.n, load) - length_acceleration
        excess_pull: Scalar = pull - self.rig.gravity_m_s2
        acceleration: Scalar = 0.0
        for effect, p in self.active_effects():
            acceleration = acceleration + effect.stretch_acceleration_m_s2(p, context, excess_pull)
        return acceleration

    # sums over the effects

    def _rope_geometry(self, context: EvaluationContext, *, errors_alone: bool = False) -> RopeGeometry:
        """Return the lengths; with `errors_alone` without what changes them in time."""
        stated = (self.rig.length_m, 0.0, 0.0), (self.rig.position_m, 0.0, 0.0)
        geometry = RopeGeometry(*stated, is_placed_from_load=self.rig.is_placed_from_load)
        for effect, p in self.active_effects():
            if effect.scales_period or not errors_alone:
                geometry = effect.rope_geometry(p, context, geometry)
        return geometry

    def _rigging(self) -> Rigging | None:
        return self._first(lambda effect, p: effect.rigging(p))

    def _heavy_rope(self, geometry: RopeGeometry) -> HeavyRope | None:
        return self._first(lambda effect, p: effect.heavy_rope(p, self.rig.gravity_m_s2, geometry))

    def _housing_on_bent_rope(self, state: State, kinematics: Kinematics) -> HousingOnBentRope:
        rope = self._heavy_rope(kinematics.geometry)
        if rope is None:
            raise ValueError("an effect with the structure HEAVY_ROPE has no heavy_rope")
        return HousingOnBentRope.of(rope, state, kinematics)

    def _pivot_compliance(self) -> Vector | None:
        return self._first(lambda effect, p: effect.pivot_compliance_m(p))

    def _first(self, of: Callable[[Effect, Symbols], T | None]) -> T | None:
        """Return what the only effect of a structure gives; None where no effect does."""
        found = (of(effect, p) for effect, p in self.active_effects())
        return next((each for each in found if each is not None), None)

    def _sum(self, of: Callable[[Effect, Symbols], Vector]) -> Vector:
        return reduce(eq.add, (of(effect, p) for effect, p in self.active_effects()), ZERO_VECTOR)

    def _load(self, state: State, geometry: RopeGeometry) -> BodyState:
        position, velocity = on_straight_rope(state, geometry.length)
        rigging = self._rigging()
        if rigging is not None:
            position = eq.add(position, eq.scale(rigging.length_m, state.m))
            velocity = eq.add(velocity, eq.scale(rigging.length_m, state.m_rate))
        return BodyState(position, velocity, self._small_swing_rate_1_s, state.presliding)

    @property
    def _small_swing_rate_1_s(self) -> Scalar:
        length = self._rope_geometry(self.context(0.0, 0.0), errors_alone=True).oscillation_length[0]
        return ca.sqrt(self.rig.gravity_m_s2 / length)

    # the sensor's chain

    def true_time(self, recorded_s: Expression) -> Expression:
        """Return the true time of a recorded time, both since the first sample of the recording."""
        for effect, p in self.active_effects():
            recorded_s = effect.true_time_s(p, recorded_s)
        return recorded_s

    def reading(self, x: Expression, context: EvaluationContext) -> Expression:
        """Return the specific force in g that the sensor reads, before its low-pass."""
        reading = self._ideal_reading(x, context)
        if any(effect.needs_quadrature for effect in self.effects):
            context = replace(
                context, quadrature_g=self._quadrature(x, context), small_swing_rate_1_s=self._small_swing_rate_1_s
            )
        for effect, p in self.active_effects():
            reading = effect.reading_g(p, context, reading)
        return ca.vertcat(*reading)

    def _ideal_reading(self, x: Expression, context: EvaluationContext) -> Vector:
        """Return the specific force in g in the housing's axes."""
        state = State.of(x, self.structure)
        kinematics = self._kinematics(state, context)
        gravity, motion = self.rig.gravity_m_s2, (state.n, state.n_rate, kinematics.n_acceleration)
        force = eq.specific_force(*motion, kinematics.pivot_acceleration, gravity, *kinematics.geometry.position)
        housing = BodyState(*on_straight_rope(state, kinematics.geometry.position), self._small_swing_rate_1_s)
        force = eq.add(force, self._sum(lambda effect, p: effect.fictitious_acceleration_m_s2(p, context, housing)))
        rotation = self._housing_rotation(context)
        along_x, along_y = self._lever_arm(rotation)
        force = eq.add(force, eq.lever_arm_acceleration(*motion, state.x_axis, along_x, along_y))
        n, x_axis = state.n, state.x_axis
        if self.structure is ModelStructure.HEAVY_ROPE:
            on_bent_rope = self._housing_on_bent_rope(state, kinematics)
            force = eq.add(force, on_bent_rope.acceleration_m_s2)
            n, x_axis = on_bent_rope.axes(x_axis)
        x, y, z = eq.in_housing(n, x_axis, force)
        cos, sin = ca.cos(rotation[0]), ca.sin(rotation[0])
        return eq.scale(1 / gravity, (cos * x + sin * y, cos * y - sin * x, z))

    def _quadrature(self, x: Expression, context: EvaluationContext) -> Vector:
        """Return the derivative of the ideal reading along the motion over √(g/L)."""
        state = ca.SX.sym("state", state_size(self.structure))
        rate = ca.jtimes(ca.vertcat(*self._ideal_reading(state, context)), state, self.rate(state, context))
        return vector(ca.substitute(rate, state, x) / self._small_swing_rate_1_s, 0)

    def _housing_rotation(self, context: EvaluationContext) -> WithDerivatives:
        """Return the rotation of the housing about the rope, beyond parallel transport, in rad, rad/s, rad/s²."""
        time = ca.SX.sym("time")
        at_time, angle = replace(context, time_s=time), ca.SX(0.0)
        for effect, p in self.active_effects():
            angle = angle + effect.housing_rotation_rad(p, at_time)
        rate = ca.jacobian(angle, time)
        rotation = ca.vertcat(angle, rate, ca.jacobian(rate, time))
        return vector(ca.substitute(rotation, time, context.time_s), 0)

    def _lever_arm(self, rotation: WithDerivatives) -> tuple[WithDerivatives, WithDerivatives]:
        """Return the lever arm along the axes of parallel transport, from that along the axes of the housing."""
        x, y = 0.0, 0.0
        for effect, p in self.active_effects():
            more_x, more_y = effect.lever_arm_m(p)
            x, y = x + more_x, y + more_y
        angle, rate, acceleration = rotation
        x, y = ca.cos(angle) * x - ca.sin(angle) * y, ca.sin(angle) * x + ca.cos(angle) * y
        along_x = (x, -rate * y, -acceleration * y - rate**2 * x)
        along_y = (y, rate * x, acceleration * x - rate**2 * y)
        return along_x, along_y

    def output(self, reading: Expression) -> Expression:
        """Return the sensor's output for a filtered reading."""
        output = vector(reading, 0)
        for effect, p in self.active_effects():
            output = effect.output_stage_g(p, output)
        return ca.vertcat(*output)
