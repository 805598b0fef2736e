"""The load and the rope as bodies with inertia."""

import math
from dataclasses import replace

import numpy as np

from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import EvaluationContext, RopeGeometry
from gateway.twin.effects.experiments import MEASURE_TO_CENTRE, WEIGH_LOAD
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.rope import RopeLength

MAX_SHORTENING = -1 / 3
"""Change of the equivalent length with a rope alone, without a load."""


class LoadInertia(Effect):
    """The moment of inertia of a load that turns with the rope: a compound pendulum."""

    name = "load_inertia"
    equation = "L in the equation of motion → L + k²/L, the distance to the centre of oscillation"
    explains = (
        "The load is long or bulky and turns with the rope: it swings more slowly than a point load at its centre."
    )
    reference = "compound pendulum, Huygens 1673: ω² = g L/(L² + k²)"
    enters = "load"
    discriminating_experiment = MEASURE_TO_CENTRE
    linear_at_neutral = False
    coincides_with = RopeLength.name
    scales_period = True
    parameters = (
        Parameter(
            "radius_of_gyration_m",
            "m",
            "k, radius of gyration about a horizontal axis through the load's centre",
            lower=0.0,
            upper=100.0,
            neutral=0.0,
            scale=0.05,
            typical=1.0,
        ),
    )

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Give the load its inertia; the distances to its centre and to the housing stay."""
        return replace(geometry, gyration_squared_m2=p["radius_of_gyration_m"] ** 2)

    def equivalent_values(self, coincident: Values, length_m: float) -> Values | None:
        """Return k = L √e of a length that seems longer by the share e."""
        relative_error = float(np.asarray(coincident["relative_error"]))
        return {"radius_of_gyration_m": length_m * math.sqrt(relative_error)} if relative_error > 0 else None


class RopeMass(Effect):
    """The mass of a heavy, straight rope beside that of the load."""

    name = "rope_mass"
    equation = "L in the equation of motion → L (1 + μ/3)/(1 + μ/2), μ = λ L"
    explains = "The rope is heavy beside the load: it swings a little faster than its length says."
    reference = (
        "Rayleigh's principle with a straight rope, Inman 2014, section 1.4: J = m L² (1 + μ/3), m g L (1 + μ/2)"
    )
    enters = "rope"
    discriminating_experiment = WEIGH_LOAD
    linear_at_neutral = False
    coincides_with = RopeLength.name
    scales_period = True
    parameters = (
        Parameter(
            "relative_density_1_m",
            "1/m",
            "λ, mass of all parts of line in a metre of length over that of the load",
            lower=0.0,
            upper=10.0,
            neutral=0.0,
            scale=1e-3,
            typical=5e-3,
        ),
    )

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Shorten the length of the equivalent pendulum; L′ stays, since d/dt m L² (1 + μ/3) = 2 m L L′ (1 + μ/2)."""
        length, rate, acceleration = geometry.length
        mass_ratio = p["relative_density_1_m"] * length
        return replace(geometry, length=(length * (1 + mass_ratio / 3) / (1 + mass_ratio / 2), rate, acceleration))

    def equivalent_values(self, coincident: Values, length_m: float) -> Values | None:
        """Return λ of a length that seems shorter by the share −e: μ = −6 e/(1 + 3 e), for −1/3 < e < 0."""
        error = float(np.asarray(coincident["relative_error"]))
        if not MAX_SHORTENING < error < 0:
            return None
        return {"relative_density_1_m": -6 * error / (1 + 3 * error) / length_m}
