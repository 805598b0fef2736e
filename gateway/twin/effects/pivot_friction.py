"""Friction of the pivot that holds before it slides."""

import casadi as ca
import numpy as np

from devices.pendulum.equations import Vector, add, cross, dot, scale
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext
from gateway.twin.effects.experiments import SWING_TO_REST
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Parameter, Symbols, Values

MIN_REVERSAL_RAD = 0.04
"""Phase of a small swing that a reversal of the friction takes at least. Basis: a contact that follows faster needs shorter
steps."""
SMOOTHING_RAD = 1e-6
"""Angle whose rate, over the swing's, smooths the speed where it vanishes."""
MAX_REMAINING_AMPLITUDE = 0.95
"""Amplitude in the last fifth over that in the first. Basis: a choice; above it the swing hardly leaves the range of one
amplitude."""
PRESLIDING_GUESSES_RAD = (0.02, 0.1)


class PivotFriction(Effect):
    """Dry friction at the pivot with elastic pre-sliding, proportional to the rope's tension: Dahl's model."""

    name = "pivot_friction"
    equation = "F/m = −ε (T/m) (z/δ) × n, z′ = n × n′ − |n′| z/δ"
    explains = (
        "The pivot's bearing or pin holds elastically before it slides: the swing dies away by a constant amount, and small "
        "swings are stiffer and quicker than the rope's length says."
    )
    reference = (
        "Dahl 1968; ε = μ a/L of a pin of radius a; small swings: A′ = −(2/π) ε ω (1 − δ/A), ω² up by 1.6 ε √δ A^(−3/2)"
    )
    enters = "force on the load"
    discriminating_experiment = SWING_TO_REST
    linear_at_neutral = False
    structure = ModelStructure.PRESLIDING
    parameters = (
        Parameter(
            "hold_rad",
            "rad",
            "ε, largest angle from its rest at which the friction holds the load",
            lower=0.0,
            upper=0.2,
            neutral=0.0,
            scale=1e-4,
            typical=5e-4,
        ),
        Parameter(
            "presliding_rad",
            "rad",
            "δ, rotation by which the contact yields before it slides",
            lower=1e-3,
            upper=0.1,
            neutral=0.02,
            scale=1e-3,
            typical=0.02,
            limit=0.019,  # a pin of 10 mm that yields by 0.4 mm
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return a short and a long pre-sliding rotation if the swing dies away; at one amplitude it is a longer rope."""
        fifth = len(context.time_s) // 5
        first, last = (float(np.std(context.force_g[rows, :2])) for rows in (slice(fifth), slice(-fifth, None)))
        if last > MAX_REMAINING_AMPLITUDE * first:
            return []
        return [{"hold_rad": 5e-4, "presliding_rad": each} for each in PRESLIDING_GUESSES_RAD]

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force of the torque at the load, under the tension of a swing without other forces."""
        length = ca.sqrt(dot(load.position_m, load.position_m))
        n = scale(1 / length, load.position_m)
        tension = -context.gravity_m_s2 * n[2] + dot(load.velocity_m_s, load.velocity_m_s) / length
        return scale(-p["hold_rad"] * tension / p["presliding_rad"], cross(load.presliding_rad, n))

    def presliding_rate_rad_s(self, p: Symbols, load: BodyState) -> Vector:
        """Return Dahl's law; the contact follows no faster than a step of the integration does."""
        turning = scale(1 / dot(load.position_m, load.position_m), cross(load.position_m, load.velocity_m_s))
        speed = ca.sqrt(dot(turning, turning) + (SMOOTHING_RAD * load.small_swing_rate_1_s) ** 2)
        relaxation_1_s = speed / p["presliding_rad"]
        slowed = (1 + (relaxation_1_s * MIN_REVERSAL_RAD / load.small_swing_rate_1_s) ** 4) ** 0.25
        return scale(1 / slowed, add(turning, scale(-relaxation_1_s, load.presliding_rad)))
