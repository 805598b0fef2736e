"""Terms of the force on the load, coefficients times vectors of its motion; and of the motion of pivot, rope and housing."""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector, add, scale
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, BodyState, EvaluationContext, RopeGeometry
from gateway.twin.effects.parameter import Symbols, Values
from gateway.twin.effects.term import HORIZONTAL, Coefficients, CoefficientTerm, Term, periodic

Basis = Callable[[BodyState], tuple[Vector, ...]]
"""The vectors that the coefficients multiply, one for each component."""
MIRRORED = ("xx", "xy")
"""Components of a symmetric matrix without a trace: (a, b; b, -a)."""


class ForceTerm(CoefficientTerm):
    """A force on the load over its mass."""

    enters = "force on the load"
    quantity = "force/mass"

    def __init__(
        self, name: str, formula: str, coefficients: Coefficients, basis: Basis, *, says: tuple[str, str]
    ) -> None:
        super().__init__(name, formula, coefficients, says=says)
        self.world_directed = bool(coefficients.components) and not coefficients.is_periodic
        self._basis = basis

    def feeds_energy(self, values: Values) -> bool:
        """Return whether the force is along the velocity."""
        return self._basis in ALONG_MOTION and all(np.min(values[each.name]) > 0 for each in self.coefficients)

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the sum of coefficients times vectors."""
        total = ZERO_VECTOR
        for each, vector in zip(self.course.at(p, context), self._basis(load), strict=True):
            total = add(total, scale(each, vector))
        return total


def _velocity(load: BodyState) -> tuple[Vector, ...]:
    return (load.velocity_m_s,)


def _speed_velocity(load: BodyState) -> tuple[Vector, ...]:
    return (scale(load.speed_m_s, load.velocity_m_s),)


def _direction_of_motion(load: BodyState) -> tuple[Vector, ...]:
    return (load.direction_of_motion(),)


def _displacement(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.position_m
    return ((x, y, 0.0),)


def _mirrored_displacement(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.position_m
    return (x, -y, 0.0), (y, x, 0.0)


def _velocity_aside(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.velocity_m_s
    return ((-y, x, 0.0),)


def _horizontal(load: BodyState) -> tuple[Vector, ...]:
    return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


ALONG_MOTION = (_velocity, _speed_velocity, _direction_of_motion)
FED, TAKEN = "energy is fed in", "energy is taken out"
FORCE_TERMS: tuple[Term, ...] = (
    ForceTerm("force_by_velocity", "v", Coefficients("1/s", 4e-3), _velocity, says=(FED, TAKEN)),
    ForceTerm(
        "force_by_speed_squared",
        "|v| v",
        Coefficients("1/m", 4e-3),
        _speed_velocity,
        says=(f"{FED}, more at large swings", f"{TAKEN}, more at large swings"),
    ),
    ForceTerm(
        "force_along_motion",
        "v/|v|",
        Coefficients("m/s²", 3e-3),
        _direction_of_motion,
        says=(f"{FED}, whatever the speed", f"{TAKEN}, whatever the speed, as by friction"),
    ),
    ForceTerm(
        "force_by_displacement",
        "(x, y)",
        Coefficients("1/s²", 5e-3),
        _displacement,
        says=("softer than a pendulum", "stiffer than a pendulum"),
    ),
    ForceTerm(
        "force_by_mirrored_displacement",
        "(x, −y), (y, x)",
        Coefficients("1/s²", 5e-3, MIRRORED),
        _mirrored_displacement,
        says=("stiffer in one direction than across it",) * 2,
    ),
    ForceTerm(
        "force_across_velocity",
        "z × v",
        Coefficients("1/s", 4e-3),
        _velocity_aside,
        says=("the plane of the swing turns anticlockwise", "the plane of the swing turns clockwise"),
    ),
    ForceTerm(
        "constant_force",
        "(e_x, e_y)",
        Coefficients("m/s²", 0.02, HORIZONTAL),
        _horizontal,
        says=("a steady push to one side",) * 2,
    ),
    ForceTerm(
        "periodic_force",
        "sin(2π f t + φ)",
        periodic("m/s²", 0.05, HORIZONTAL),
        _horizontal,
        says=("the load is pushed at one frequency, as by gusts",) * 2,
    ),
)


class PivotTerm(CoefficientTerm):
    """An acceleration of the pivot, horizontal with two components and vertical with one."""

    enters = "pivot"
    quantity = "pivot acceleration"

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the acceleration."""
        found = self.course.at(p, context)
        return (found[0], found[1], 0.0) if self.course.components else (0.0, 0.0, found[0])


class LengthTerm(CoefficientTerm):
    """A rope whose length changes; the housing keeps its distance to the load."""

    enters = "rope"
    quantity = "rope length"

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Change both distances."""
        time = ca.SX.sym("time")
        (change,) = self.course.at(p, replace(context, time_s=time))
        rate = ca.jacobian(change, time)
        parts = ca.vertcat(change, rate, ca.jacobian(rate, time))
        changes = ca.vertsplit(ca.substitute(parts, time, context.time_s))
        return geometry.with_changes(changes, changes)


class RotationTerm(CoefficientTerm):
    """A rotation of the housing about the rope."""

    enters = "housing"
    quantity = "rotation about the rope"

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle."""
        return self.course.at(p, context)[0]


class SteadyRotation(RotationTerm):
    """A housing that turns evenly; its angle at the first sample is the heading."""

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle."""
        return super().housing_rotation_rad(p, context) * context.time_s


KINEMATIC_TERMS: tuple[Term, ...] = (
    PivotTerm(
        "pivot_sway",
        "sin(2π f t + φ), horizontal",
        periodic("m/s²", 0.05, HORIZONTAL),
        says=("the pivot moves to and fro, as by a jib or a gantry that sways",) * 2,
    ),
    PivotTerm(
        "pivot_heave",
        "sin(2π f t + φ), vertical",
        periodic("m/s²", 0.05),
        says=("the pivot rises and falls, as of a floating crane",) * 2,
    ),
    LengthTerm(
        "periodic_length",
        "sin(2π f t + φ)",
        periodic("m", 0.005),
        says=("the rope becomes longer and shorter, as by a winch that hunts",) * 2,
    ),
    RotationTerm(
        "periodic_rotation",
        "sin(2π f t + φ)",
        periodic("rad", 0.05),
        says=("the housing twists to and fro about the rope",) * 2,
    ),
    SteadyRotation(
        "steady_rotation",
        "t",
        Coefficients("rad/s", 0.01),
        says=("the housing turns anticlockwise about the rope", "the housing turns clockwise about the rope"),
    ),
)
