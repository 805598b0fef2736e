"""The state of a motion, and the coordinates of its start that can be fitted; both as symbols.

State x: n, n' and the housing's x axis; with a double pendulum the rigging's direction m and m', with an elastic rope its
stretch beyond that of a load at rest, and the stretch's rate.
Start z: the rope's tilts toward world x and y, their rates, the housing's heading; then the rigging's tilts and rates, or the
stretch and its rate.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from devices.pendulum import equations as eq
from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import Effect, ModelStructure

Expression = Any
NOTHING: Vector = (0.0, 0.0, 0.0)


def structure_of(effects: Iterable[Effect]) -> ModelStructure:
    """Structure of a model with these effects. Raises `ValueError` for two that exclude each other."""
    structural = [effect for effect in effects if effect.structure is not ModelStructure.ROPE]
    if len({effect.structure for effect in structural}) > 1:
        names = " and ".join(effect.name for effect in structural)
        raise ValueError(f"{names} cannot act together: leave one of them out")
    return structural[0].structure if structural else ModelStructure.ROPE


@dataclass(frozen=True, slots=True)
class State:
    """x by its parts; what a structure has not is zero."""

    n: Vector
    n_rate: Vector
    x_axis: Vector
    m: Vector = NOTHING
    m_rate: Vector = NOTHING
    stretch: Scalar = 0.0
    stretch_rate: Scalar = 0.0

    @classmethod
    def of(cls, x: Expression, structure: ModelStructure) -> "State":
        """The parts of a column."""
        rope = vector(x, 0), vector(x, 3), vector(x, 6)
        if structure is ModelStructure.RIGGING:
            return cls(*rope, vector(x, 9), vector(x, 12))
        if structure is ModelStructure.ELASTIC:
            return cls(*rope, stretch=x[9], stretch_rate=x[10])
        return cls(*rope)

    def column(self, structure: ModelStructure) -> Expression:
        """x of the parts; of their rates just so."""
        parts = [*self.n, *self.n_rate, *self.x_axis]
        if structure is ModelStructure.RIGGING:
            parts += [*self.m, *self.m_rate]
        if structure is ModelStructure.ELASTIC:
            parts += [self.stretch, self.stretch_rate]
        return ca.vertcat(*parts)


def vector(column: Expression, first: int) -> Vector:
    """Three components of a column."""
    return column[first], column[first + 1], column[first + 2]


def state_from_initial(z: Expression, structure: ModelStructure) -> Expression:
    """x of z."""
    n, n_rate = _direction(z[0], z[1], z[2], z[3])
    across, along = _reference_axes(n)
    x_axis = eq.add(eq.scale(ca.cos(z[4]), across), eq.scale(ca.sin(z[4]), along))
    state = State(n, n_rate, x_axis)
    if structure is ModelStructure.RIGGING:
        state = State(n, n_rate, x_axis, *_direction(z[5], z[6], z[7], z[8]))
    if structure is ModelStructure.ELASTIC:
        state = State(n, n_rate, x_axis, stretch=z[5], stretch_rate=z[6])
    return state.column(structure)


def initial_from_state(x: Expression, structure: ModelStructure) -> Expression:
    """z of x."""
    state = State.of(x, structure)
    across, along = _reference_axes(state.n)
    heading = ca.atan2(eq.dot(state.x_axis, along), eq.dot(state.x_axis, across))
    z = [*_tilts(state.n, state.n_rate), heading]
    if structure is ModelStructure.RIGGING:
        z += _tilts(state.m, state.m_rate)
    if structure is ModelStructure.ELASTIC:
        z += [state.stretch, state.stretch_rate]
    return ca.vertcat(*z)


def _direction(tilt_x: Any, tilt_y: Any, rate_x: Any, rate_y: Any) -> tuple[Vector, Vector]:
    angles = (ca.sin(tilt_x), ca.cos(tilt_x), ca.sin(tilt_y), ca.cos(tilt_y))
    by_x, by_y = eq.direction_by_tilts(*angles)
    return eq.direction(*angles), eq.add(eq.scale(rate_x, by_x), eq.scale(rate_y, by_y))


def _tilts(n: Vector, n_rate: Vector) -> list[Any]:
    tilt_x, tilt_y = ca.atan2(n[0], -n[2]), ca.asin(n[1])
    by_x, by_y = eq.direction_by_tilts(ca.sin(tilt_x), ca.cos(tilt_x), ca.sin(tilt_y), ca.cos(tilt_y))
    return [tilt_x, tilt_y, eq.dot(n_rate, by_x) / eq.dot(by_x, by_x), eq.dot(n_rate, by_y)]


def _reference_axes(n: Vector) -> tuple[Vector, Vector]:
    """The axis at right angles to the rope that is nearest to the world's x, and the third one: (x, y) of heading 0."""
    x_axis = eq.reference_axis(n, ca.sqrt(1 - n[0] * n[0]))
    return x_axis, eq.cross(eq.scale(-1, n), x_axis)
