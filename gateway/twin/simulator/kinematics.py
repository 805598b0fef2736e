"""Accelerations at an instant, and points on the rope: straight, or bent by its own mass."""

from dataclasses import dataclass

import casadi as ca

from devices.pendulum import equations as eq
from devices.pendulum.equations import Scalar, Vector, WithDerivatives
from devices.pendulum.heavy_rope import BentRope, HeavyRope
from gateway.twin.effects.evaluation_context import RopeGeometry
from gateway.twin.simulator.state import State


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


def _unit(a: Vector) -> Vector:
    return eq.scale(1 / ca.sqrt(eq.dot(a, a)), a)
