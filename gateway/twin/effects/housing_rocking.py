"""Rocking of the housing on its clamp."""

import casadi as ca

from devices.pendulum.equations import Vector
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.experiments import MEASURE_CLAMP
from gateway.twin.effects.parameter import Parameter, Symbols
from gateway.twin.effects.sensor import rotate_across


class HousingRocking(Effect):
    """A rotation of the housing on its clamp in proportion to the specific force across the rope.

    This is the static compliance of the clamp: a housing of mass m, a distance h below its clamp, on a rotational stiffness k
    turns by m h/k per specific force. The rocking mode itself, at some 5 to 50 Hz, is far above the swing; where it rings, it
    is a vibration.
    """

    name = "housing_rocking"
    equation = "θ = (−C_y f_y, C_x f_x, 0), f_s = R(θ) f"
    explains = "The housing is loose on its clamp and rocks with the swing."
    reference = "static deflection of a torsional spring, θ = m h f/k, Inman 2014, section 1.5"
    enters = "housing"
    discriminating_experiment = MEASURE_CLAMP
    parameters = (
        Parameter(
            "deg_per_g",
            "°/g",
            "C, rotation per specific force across the rope, positive for a housing that hangs below its clamp",
            lower=-40.0,
            upper=40.0,
            neutral=0.0,
            scale=0.05,
            typical=(3.0, 3.0),
            limit=10.0,
            components=("x", "y"),
        ),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Rotate by the specific force across the rope."""
        x, y, _ = reading
        by_x, by_y = (ca.pi / 180 * each for each in p["deg_per_g"])
        return rotate_across(reading, by_y * y, -by_x * x)
