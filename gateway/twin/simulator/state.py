"""The state of the motion, the initial state that a fit can vary, and points on the rope; all as symbols.

State x: the rope's direction n, its rate n' and the housing's x axis; with a double pendulum also the direction of the rigging
m and its rate m', with an elastic rope also the stretch beyond that of a load at rest, and the rate of the stretch, with friction
that holds also the rotation of the pivot's contact before it slides, with a heavy rope also its bow and the rate of that, both at
right angles to n.
Initial state z: the tilts of the rope toward the world's x and y, their rates, and the heading of the housing; then the tilts
and rates of the rigging, the stretch and its rate, the rotation of the contact about the world's x and y, or
the bow and its rate toward the world's x and y. The parameter vector of a simulator is z, then the numbers of the effects.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

import casadi as ca

from devices.pendulum import equations as eq
from devices.pendulum.equations import Scalar, Vector, WithDerivatives
from devices.pendulum.heavy_rope import BentRope, HeavyRope
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, RopeGeometry
from gateway.twin.effects.parameter import EVENT_TIME_KINDS, Parameter, ParameterKind

TILTS = (
    ("tilt_x_rad", "rad", 3.1),
    ("tilt_y_rad", "rad", 1.5),
    ("rate_x_rad_s", "rad/s", 50.0),
    ("rate_y_rad_s", "rad/s", 50.0),
)
"""Name, unit and limit of each coordinate. Basis: the tilt toward y is an arc sine, so it must stay below 90 degrees."""
ADDED: Mapping[ModelStructure, tuple[tuple[str, str, float], ...]] = {
    ModelStructure.RIGGING: tuple((f"rigging_{name}", unit, limit) for name, unit, limit in TILTS),
    ModelStructure.ELASTIC: (("stretch_m", "m", 0.5), ("stretch_rate_m_s", "m/s", 5.0)),
    ModelStructure.PRESLIDING: (("contact_x_rad", "rad", 0.2), ("contact_y_rad", "rad", 0.2)),
    ModelStructure.HEAVY_ROPE: (
        ("bow_x_m", "m", 5.0),
        ("bow_y_m", "m", 5.0),
        ("bow_rate_x_m_s", "m/s", 50.0),
        ("bow_rate_y_m_s", "m/s", 50.0),
    ),
}
"""The same for what a structure adds. Basis: a choice; far beyond what a fit should reach."""
INITIAL_STATE_SCALE = 1e-3
"""A change of an initial state that an operator would call small. Basis: a choice; a milliradian or millimetre."""


@dataclass(frozen=True, slots=True)
class ParameterSpec(Parameter):
    """One number of the parameter vector: a component of a parameter, with its bounds on this rope."""

    effect: str = ""
    """Name of the effect; empty for an initial state."""
    component: int = 0

    @property
    def part(self) -> str:
        """Name of the component, or of the parameter where it has none."""
        return self.components[self.component] if self.components else self.name

    @property
    def label(self) -> str:
        """`steady_wind.accel_m_s2[x]`, `initial.tilt_x_rad`."""
        return f"{self.effect or 'initial'}.{self.name}" + (f"[{self.part}]" if self.components else "")

    @property
    def is_event_time(self) -> bool:
        """Whether the number determines when an event acts, and not how strongly."""
        return self.kind in EVENT_TIME_KINDS

    def convert(self, number: float) -> float:
        """Return the number of the vector for one of the parameter, or the other way round: a cutoff stands by its inverse."""
        return 1 / number if self.kind is ParameterKind.CUTOFF else number


@lru_cache
def initial_state_specs(structure: ModelStructure) -> tuple[ParameterSpec, ...]:
    """Return the coordinates of the initial state."""
    kinds = (*TILTS, ("heading_rad", "rad", 7.0), *ADDED.get(structure, ()))
    return tuple(
        ParameterSpec(name, unit, "", -limit, limit, 0.0, INITIAL_STATE_SCALE, 0.0, refitted=True)
        for name, unit, limit in kinds
    )


@lru_cache
def effect_parameter_specs(effect: Effect, length_m: float) -> tuple[ParameterSpec, ...]:
    """Return the numbers of an effect on a rope of this nominal length."""
    bounded = [_in_vector(p, effect.upper_bound(p, length_m)) for p in effect.parameters]
    known = [({each.name: getattr(p, each.name) for each in fields(Parameter)}, p.size) for p in bounded]
    return tuple(ParameterSpec(**own, effect=effect.name, component=i) for own, size in known for i in range(size))


def _in_vector(p: Parameter, upper: float) -> Parameter:
    if p.kind is ParameterKind.CUTOFF:
        return replace(p, lower=1 / upper, upper=1 / p.lower, neutral=1 / min(p.neutral, upper))
    return replace(p, upper=upper, neutral=min(p.neutral, upper))


Expression = Any
ROPE_TILTS, ROPE_RATES = slice(0, 2), slice(2, 4)
"""Positions in z of the rope's tilts (x, y), and of their rates."""
HEADING = 4
"""Position in z of the housing's heading. Definition: of the layout of z."""
RIGGING_TILTS, RIGGING_RATES = slice(5, 7), slice(7, 9)
"""Positions in z of the rigging's tilts (x, y), and of their rates."""
STRETCH, STRETCH_RATE = 5, 6
"""Positions in z of the stretch of an elastic rope, and of its rate. Definition: of the layout of z."""
PRESLIDING = slice(5, 7)
"""Positions in z of the rotation of the contact (about x, about y)."""
BOW, BOW_RATE = slice(5, 7), slice(7, 9)
"""Positions in z of the bow of a heavy rope (x, y), and of its rate."""


ROPE_PARTS = ("n", "n_rate", "x_axis")
ADDED_PARTS: Mapping[ModelStructure, tuple[str, ...]] = {
    ModelStructure.RIGGING: ("m", "m_rate"),
    ModelStructure.ELASTIC: ("stretch", "stretch_rate"),
    ModelStructure.PRESLIDING: ("presliding",),
    ModelStructure.HEAVY_ROPE: ("bow", "bow_rate"),
}
"""Parts of x in their order: of a rope, and what a structure adds."""
SCALAR_PARTS = ("stretch", "stretch_rate")
"""Parts that are numbers; the others are vectors."""


def parts_of(structure: ModelStructure) -> tuple[str, ...]:
    """Return the names of the parts of x."""
    return (*ROPE_PARTS, *ADDED_PARTS.get(structure, ()))


def state_size(structure: ModelStructure) -> int:
    """Return the length of x."""
    return sum(1 if name in SCALAR_PARTS else 3 for name in parts_of(structure))


def structure_of(effects: Iterable[Effect]) -> ModelStructure:
    """Return the structure of a model with these effects. Raises `ValueError` for two that exclude each other."""
    structural = [effect for effect in effects if effect.structure is not ModelStructure.ROPE]
    if len({effect.structure for effect in structural}) > 1:
        names = " and ".join(effect.name for effect in structural)
        raise ValueError(f"{names} cannot act together: leave one of them out")
    return structural[0].structure if structural else ModelStructure.ROPE


@dataclass(frozen=True, slots=True)
class State:
    """The parts of x; parts that a structure lacks are zero."""

    n: Vector
    n_rate: Vector
    x_axis: Vector
    m: Vector = ZERO_VECTOR
    m_rate: Vector = ZERO_VECTOR
    stretch: Scalar = 0.0
    stretch_rate: Scalar = 0.0
    presliding: Vector = ZERO_VECTOR
    bow: Vector = ZERO_VECTOR
    bow_rate: Vector = ZERO_VECTOR

    @classmethod
    def of(cls, x: Expression, structure: ModelStructure) -> "State":
        """Return the parts of a column x."""
        numbers = iter(ca.vertsplit(x))
        parts: dict[str, Any] = {}
        for name in parts_of(structure):
            is_scalar = name in SCALAR_PARTS
            parts[name] = next(numbers) if is_scalar else (next(numbers), next(numbers), next(numbers))
        return cls(**parts)

    def column(self, structure: ModelStructure) -> Expression:
        """Return the column x of these parts, or its rate of the rates of the parts."""
        parts = (getattr(self, name) for name in parts_of(structure))
        return ca.vertcat(*(each for part in parts for each in (part if isinstance(part, tuple) else (part,))))


def vector(column: Expression, first: int) -> Vector:
    """Return three components of a column."""
    return column[first], column[first + 1], column[first + 2]


def state_from_initial(z: Expression, structure: ModelStructure) -> Expression:
    """Return the state x of an initial state z."""
    n, n_rate = _direction(z[ROPE_TILTS], z[ROPE_RATES])
    across, along = _reference_axes(n)
    x_axis = eq.add(eq.scale(ca.cos(z[HEADING]), across), eq.scale(ca.sin(z[HEADING]), along))
    state = State(n, n_rate, x_axis)
    if structure is ModelStructure.RIGGING:
        state = State(n, n_rate, x_axis, *_direction(z[RIGGING_TILTS], z[RIGGING_RATES]))
    if structure is ModelStructure.ELASTIC:
        state = State(n, n_rate, x_axis, stretch=z[STRETCH], stretch_rate=z[STRETCH_RATE])
    if structure is ModelStructure.PRESLIDING:
        state = State(n, n_rate, x_axis, presliding=(*ca.vertsplit(z[PRESLIDING]), 0.0))
    if structure is ModelStructure.HEAVY_ROPE:
        state = State(n, n_rate, x_axis, bow=_right_angled(n, z[BOW]), bow_rate=_right_angled(n, z[BOW_RATE]))
    return state.column(structure)


def initial_from_state(x: Expression, structure: ModelStructure) -> Expression:
    """Return the initial state z of a state x."""
    state = State.of(x, structure)
    across, along = _reference_axes(state.n)
    heading = ca.atan2(eq.dot(state.x_axis, along), eq.dot(state.x_axis, across))
    z = [*_tilts(state.n, state.n_rate), heading]
    if structure is ModelStructure.RIGGING:
        z += _tilts(state.m, state.m_rate)
    if structure is ModelStructure.ELASTIC:
        z += [state.stretch, state.stretch_rate]
    if structure is ModelStructure.PRESLIDING:
        z += state.presliding[:2]
    if structure is ModelStructure.HEAVY_ROPE:
        z += [*state.bow[:2], *state.bow_rate[:2]]
    return ca.vertcat(*z)


def on_constraints(x: Expression, structure: ModelStructure) -> Expression:
    """Return a state with directions of length one, and rates and the x axis at right angles to them.

    Every motion has them; an integration that leaves them by its rounding diverges where the rope is pushed, beyond 90 degrees
    (Hairer et al. 2006, section IV.4).
    """
    state = State.of(x, structure)
    n = _unit(state.n)
    constrained = replace(state, n=n, n_rate=_across(n, state.n_rate), x_axis=_unit(_across(n, state.x_axis)))
    if structure is ModelStructure.RIGGING:
        m = _unit(state.m)
        constrained = replace(constrained, m=m, m_rate=_across(m, state.m_rate))
    return constrained.column(structure)


def _unit(a: Vector) -> Vector:
    return eq.scale(1 / ca.sqrt(eq.dot(a, a)), a)


def _across(n: Vector, a: Vector) -> Vector:
    return eq.add(a, eq.scale(-eq.dot(n, a), n))


@lru_cache
def rotation_about_vertical(structure: ModelStructure) -> Any:
    """Return a function of an initial state and an angle in rad: the same state in a world rotated about the vertical."""
    z, angle = ca.SX.sym("z", len(initial_state_specs(structure))), ca.SX.sym("angle")
    cos, sin = ca.cos(angle), ca.sin(angle)

    def turn(a: Vector) -> Vector:
        return cos * a[0] - sin * a[1], sin * a[0] + cos * a[1], a[2]

    state = State.of(state_from_initial(z, structure), structure)
    turned = State(*map(turn, (state.n, state.n_rate, state.x_axis, state.m, state.m_rate)))
    turned = replace(turned, stretch=state.stretch, stretch_rate=state.stretch_rate, presliding=turn(state.presliding))
    turned = replace(turned, bow=turn(state.bow), bow_rate=turn(state.bow_rate))
    return ca.Function("rotation", [z, angle], [initial_from_state(turned.column(structure), structure)])


def _direction(tilts: Expression, rates: Expression) -> tuple[Vector, Vector]:
    """Return the direction of a rope and its rate."""
    angles = (ca.sin(tilts[0]), ca.cos(tilts[0]), ca.sin(tilts[1]), ca.cos(tilts[1]))
    by_x, by_y = eq.direction_by_tilts(*angles)
    return eq.direction(*angles), eq.add(eq.scale(rates[0], by_x), eq.scale(rates[1], by_y))


def _right_angled(n: Vector, horizontal: Expression) -> Vector:
    """Return the vector at right angles to n with this horizontal part."""
    x, y = ca.vertsplit(horizontal)
    return x, y, -(n[0] * x + n[1] * y) / n[2]


def _tilts(n: Vector, n_rate: Vector) -> list[Any]:
    """Return the tilts of a rope and their rates."""
    tilt_x, tilt_y = ca.atan2(n[0], -n[2]), ca.asin(n[1])
    by_x, by_y = eq.direction_by_tilts(ca.sin(tilt_x), ca.cos(tilt_x), ca.sin(tilt_y), ca.cos(tilt_y))
    return [tilt_x, tilt_y, eq.dot(n_rate, by_x) / eq.dot(by_x, by_x), eq.dot(n_rate, by_y)]


def _reference_axes(n: Vector) -> tuple[Vector, Vector]:
    """Return the housing's x and y axes at heading 0: x is the direction across the rope that is nearest to the world's x."""
    x_axis = eq.reference_axis(n, ca.sqrt(1 - n[0] * n[0]))
    return x_axis, eq.cross(eq.scale(-1, n), x_axis)


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Accelerations at an instant, and the geometry with them."""

    geometry: RopeGeometry
    pivot_acceleration: Vector
    drive: Vector
    """Gravity less the acceleration of a pivot that does not yield."""
    n_acceleration: Vector
    second_acceleration: Vector
    """m'' of the rigging, or that of a heavy rope's bow."""
    stretch_acceleration: Scalar


def on_straight_rope(state: State, distance: WithDerivatives) -> tuple[Vector, Vector]:
    """Return position and velocity of a point on the rope."""
    velocity = eq.add(eq.scale(distance[0], state.n_rate), eq.scale(distance[1], state.n))
    return eq.scale(distance[0], state.n), velocity


@dataclass(frozen=True, slots=True)
class HousingOnBentRope:
    """A housing where the rope is not straight."""

    bent: BentRope
    fraction: Scalar
    """Place of the housing over the length of the rope."""

    @classmethod
    def of(cls, rope: HeavyRope, state: State, kinematics: Kinematics) -> "HousingOnBentRope":
        """Return the housing at its place on a rope in this state."""
        motion = state.n, state.n_rate, kinematics.n_acceleration
        bent = BentRope(rope, *motion, state.bow, state.bow_rate, kinematics.second_acceleration, kinematics.drive)
        return cls(bent, kinematics.geometry.position[0] / rope.length)

    @property
    def turning_rad_s(self) -> Scalar:
        """Angular velocity about the rope beside axes that are carried along the line to the load."""
        return self.bent.turning(self.fraction, ca.cos(ca.pi * self.fraction))

    @property
    def acceleration_m_s2(self) -> Vector:
        """Acceleration beside that of the point on the line to the load."""
        return self.bent.acceleration(self.fraction, ca.sin(ca.pi * self.fraction))

    def axes(self, x_axis: Vector) -> tuple[Vector, Vector]:
        """Return the rope's direction at the housing, and the housing's x axis, from the one at right angles to n."""
        direction = _unit(eq.add(self.bent.n, self.bent.slope(self.fraction, ca.cos(ca.pi * self.fraction))))
        return direction, _unit(eq.add(x_axis, eq.scale(-eq.dot(x_axis, direction), direction)))
