"""Terms of a motion that is imposed: of the pivot, of the rope's length, and of the housing about the rope."""

from dataclasses import replace

import casadi as ca

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.coefficients import CoefficientTerm, ConstantCoefficients, PeriodicCoefficients
from gateway.twin.effects.evaluation_context import EvaluationContext, RopeGeometry
from gateway.twin.effects.parameter import Symbols
from gateway.twin.effects.term import HORIZONTAL, Term


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
        PeriodicCoefficients("m/s²", 0.05, HORIZONTAL),
        says=("the pivot moves to and fro, as by a jib or a gantry that sways",) * 2,
    ),
    PivotTerm(
        "pivot_heave",
        "sin(2π f t + φ), vertical",
        PeriodicCoefficients("m/s²", 0.05),
        says=("the pivot rises and falls, as of a floating crane",) * 2,
    ),
    LengthTerm(
        "periodic_length",
        "sin(2π f t + φ)",
        PeriodicCoefficients("m", 0.005),
        says=("the rope becomes longer and shorter, as by a winch that hunts",) * 2,
    ),
    RotationTerm(
        "periodic_rotation",
        "sin(2π f t + φ)",
        PeriodicCoefficients("rad", 0.05),
        says=("the housing twists to and fro about the rope",) * 2,
    ),
    SteadyRotation(
        "steady_rotation",
        "t",
        ConstantCoefficients("rad/s", 0.01),
        says=("the housing turns anticlockwise about the rope", "the housing turns clockwise about the rope"),
    ),
)
