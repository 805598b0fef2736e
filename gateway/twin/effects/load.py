"""The load as a body with inertia."""

import math
from dataclasses import replace

import numpy as np

from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import EvaluationContext, RopeGeometry
from gateway.twin.effects.experiments import MEASURE_TO_CENTRE
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.rope import RopeLength


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
