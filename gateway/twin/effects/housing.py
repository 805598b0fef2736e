"""Position and rotation of the housing."""

import casadi as ca

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext, RopeGeometry
from gateway.twin.effects.experiments import LOCK_SLEWING, MEASURE_CLAMP, MEASURE_HOUSING, MEASURE_LEVER_ARM
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.sensor import rotate_across
from gateway.twin.effects.spectral_guesses import guess_yaw_rate


class HousingPosition(Effect):
    """An error of the housing's nominal position on the rope."""

    name = "housing_position"
    equation = "r = r_nominal + e"
    explains = "The housing is clamped at another place on the rope than stated, or has slipped."
    reference = "transverse specific force of a planar swing: f_t = g sin φ (1 − r/L)"
    enters = "housing"
    discriminating_experiment = MEASURE_HOUSING
    length_like = True
    in_every_rig = True
    parameters = (
        Parameter(
            "error_m",
            "m",
            "e, positive if further from the pivot",
            lower=-100.0,
            upper=100.0,
            neutral=0.0,
            scale=0.02,
            typical=1.0,
            prior_sigma=0.05,
        ),
    )

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Move the housing alone."""
        return geometry.with_changes((), (p["error_m"],))


class LeverArm(Effect):
    """A place of the sensor beside the rope's line."""

    name = "lever_arm"
    equation = "a = a_rope + α × d + ω × (ω × d), d = (d_x, d_y, 0) in the housing's axes"
    explains = "The sensor sits beside the rope's line, so that the rotation of the rope accelerates it along the rope."
    reference = "acceleration of a point of a rigid body (Euler and centripetal terms); d_z is housing_position"
    enters = "housing"
    discriminating_experiment = MEASURE_LEVER_ARM
    in_every_rig = True
    parameters = (
        Parameter(
            "offset_m",
            "m",
            "d, from the rope's line to the accelerometer",
            lower=-1.0,
            upper=1.0,
            neutral=0.0,
            scale=2e-3,
            typical=(0.03, 0.0),
            limit=0.1,
            components=("x", "y"),
        ),
    )

    def lever_arm_m(self, p: Symbols) -> tuple[Scalar, Scalar]:
        """Return the two components."""
        x, y = p["offset_m"]
        return x, y


class HousingSpin(Effect):
    """A constant rotation of the housing about the rope."""

    name = "housing_spin"
    equation = "ψ = ψ₀ + Ω t about the housing's z axis"
    explains = "The rope untwists under load and turns the housing."
    reference = "rotation of the sensor's frame about the rope"
    enters = "housing"
    discriminating_experiment = LOCK_SLEWING
    parameters = (
        Parameter(
            "rate_deg_s",
            "°/s",
            "Ω, right-handed about the housing's z axis",
            lower=-60.0,
            upper=60.0,
            neutral=0.0,
            scale=0.02,
            typical=2.0,
            operator_sigma=0.5,
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the rate at which the figure of the swing rotates in the housing's axes."""
        return guess_yaw_rate(context)

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return an angle proportional to time."""
        return ca.pi / 180 * p["rate_deg_s"] * context.time_s


class Slewing(Effect):
    """A constant rotation of the crane about the vertical through the pivot."""

    name = "slewing"
    equation = "F/m = −2 Ω × v − Ω × (Ω × L n), seen from the turning crane"
    explains = (
        "The crane was slewing with the load near its axis: the plane of the swing stays behind as the crane turns."
    )
    reference = "Coriolis and centrifugal acceleration; the housing turns with the crane; without the radius of a jib"
    enters = "force on the load"
    discriminating_experiment = LOCK_SLEWING
    parameters = (
        Parameter(
            "rate_deg_s",
            "°/s",
            "Ω, anticlockwise from above",
            lower=-30.0,
            upper=30.0,
            neutral=0.0,
            scale=0.02,
            typical=2.0,
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the rate at which the figure of the swing rotates in the housing's axes."""
        return guess_yaw_rate(context)

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the fictitious force in the frame of the crane."""
        rate = ca.pi / 180 * p["rate_deg_s"]
        (x_rate, y_rate, _), (x, y, _) = load.velocity_m_s, load.position_m
        return 2 * rate * y_rate + rate**2 * x, -2 * rate * x_rate + rate**2 * y, 0.0

    def fictitious_acceleration_m_s2(self, p: Symbols, context: EvaluationContext, housing: BodyState) -> Vector:
        """Return the opposite of the fictitious force at the housing: the sensor does not measure it."""
        x, y, z = self.force_m_s2(p, context, housing)
        return -x, -y, -z


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
