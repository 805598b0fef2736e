"""Where the housing sits and how it turns."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import BodyState, Effect, EvaluationContext, Parameter, RopeGeometry, Symbols, Values
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.rope import MEASURE_HOUSING, add_length
from gateway.twin.effects.spectral_guesses import guess_yaw_rate

LOCK_SLEWING = "repeat with the crane's slewing locked; or look at the housing while the load swings"


class HousingPosition(Effect):
    """The housing is not where it is believed."""

    name = "housing_position"
    equation = "r = r_believed + e"
    explains = "The housing was clamped, or has slipped, to another place on the rope."
    reference = "f_t = g sin φ (1 − r/L)"
    enters = "housing"
    discriminating_experiment = MEASURE_HOUSING
    length_like = True
    parameters = (
        Parameter(
            "error_m", "m", "further from the pivot is positive", -100.0, 100.0, 0.0, 0.02, 1.0, prior_sigma=0.05
        ),
    )

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """The housing alone."""
        return replace(ropes, position=add_length(ropes.position, p["error_m"]))


class HousingSpin(Effect):
    """The housing turns about the rope."""

    name = "housing_spin"
    equation = "ψ = ψ₀ + Ω t about the housing's z axis"
    explains = "The rope untwists under load and takes the housing along."
    reference = "rotation of the frame of measurement"
    enters = "housing"
    discriminating_experiment = LOCK_SLEWING
    parameters = (Parameter("rate_deg_s", "°/s", "Ω", -60.0, 60.0, 0.0, 0.02, 2.0, operator_sigma=0.5),)

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the rate at which the figure of the swing turns in the housing's axes."""
        return guess_yaw_rate(context)

    def housing_rotation_rad(self, p: Symbols, now: EvaluationContext) -> Scalar:
        """In proportion to time."""
        return ca.pi / 180 * p["rate_deg_s"] * now.time_s


class Slewing(Effect):
    """The crane turns about the vertical."""

    name = "slewing"
    equation = "F/m = −2 Ω × v − Ω × (Ω × L n), seen from the turning crane"
    explains = (
        "The crane was slewing with the load near its axis: the plane of the swing stays behind as the crane turns."
    )
    reference = "Coriolis and centrifugal acceleration; the housing turns with the crane. Without a jib's radius"
    enters = "force on the load"
    discriminating_experiment = LOCK_SLEWING
    parameters = (Parameter("rate_deg_s", "°/s", "Ω, anticlockwise from above", -30.0, 30.0, 0.0, 0.02, 2.0),)

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the rate at which the figure of the swing turns in the housing's axes."""
        return guess_yaw_rate(context)

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """In the frame of the crane."""
        rate = ca.pi / 180 * p["rate_deg_s"]
        (x_rate, y_rate, _), (x, y, _) = load.velocity, load.place
        return 2 * rate * y_rate + rate**2 * x, -2 * rate * x_rate + rate**2 * y, 0.0

    def fictitious_acceleration_m_s2(self, p: Symbols, now: EvaluationContext, housing: BodyState) -> Vector:
        """The same, of the housing: what is fictitious in the crane's frame is not felt."""
        x, y, z = self.force_m_s2(p, now, housing)
        return -x, -y, -z
