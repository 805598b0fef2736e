"""Position and rotation of the housing, and its torsional oscillation about the rope."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import LOCK_SLEWING, MEASURE_CLAMP, MEASURE_HOUSING, MEASURE_LEVER_ARM, Effect
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext, RopeGeometry
from gateway.twin.effects.guess_context import GuessContext, guess_yaw_rate
from gateway.twin.effects.parameter import Symbols, Values, amplitude, frequency
from gateway.twin.effects.sensor import rotate_across

Array = NDArray[np.float64]
BIN_S = 0.1
"""Interval over which samples are averaged for the guess of a frequency."""
MAX_GUESS_HZ = 2.0
"""Highest frequency that is guessed: ropes twist in seconds to minutes."""
FREQUENCIES_PER_CYCLE = 4
"""Frequencies that are tried per cycle of the recording."""
MIN_GAIN = 0.3
"""Share of the residual across the rope that a guess must explain: an oscillation that is there explains most of it."""


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
        amplitude("error_m", "m", "e, positive if further from the pivot", (-100.0, 100.0), 1.0, prior_sigma=0.05),
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
        amplitude(
            "offset_m", "m", "d, from the rope to the accelerometer", (-1.0, 1.0), (0.03, 0.0), ("x", "y"), limit=0.1
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
        amplitude(
            "rate_deg_s", "°/s", "Ω, right-handed about the housing's z axis", (-60.0, 60.0), 2.0, operator_sigma=0.5
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
    parameters = (amplitude("rate_deg_s", "°/s", "Ω, anticlockwise from above", (-30.0, 30.0), 2.0),)

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
        amplitude(
            "deg_per_g",
            "°/g",
            "C, rotation per specific force across the rope, positive for a housing that hangs below its clamp",
            (-40.0, 40.0),
            3.0,
            ("x", "y"),
            limit=10.0,
        ),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Rotate by the specific force across the rope."""
        x, y, _ = reading
        by_x, by_y = (ca.pi / 180 * each for each in p["deg_per_g"])
        return rotate_across(reading, by_y * y, -by_x * x)


class HousingTorsion(Effect):
    """A free torsional oscillation of the rope, which turns the housing to and fro."""

    name = "housing_torsion"
    equation = "ψ″ + 2 ζ ω ψ′ + ω² ψ = 0 about the housing's z axis, ω = 2π f"
    explains = "The rope twists to and fro and turns the housing with it."
    reference = "free vibration with viscous damping, Inman 2014, section 1.3; torsional pendulum, section 1.5"
    enters = "housing"
    linear_at_neutral = False
    discriminating_experiment = LOCK_SLEWING
    parameters = (
        frequency("f", (1e-3, 10.0), 0.1, step_limit=0.01),
        amplitude("damping_ratio", "1", "ζ", (0.0, 0.5), 0.01, step_limit=0.05),
        amplitude(
            "start_deg",
            "°",
            "ψ and (ψ′ + ζ ω ψ)/ω at the first sample",
            (-180.0, 180.0),
            (8.0, 0.0),
            ("angle", "rate"),
            refitted=True,
            step_limit=10.0,
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the undamped oscillation whose small rotations take the most off the residual across the rope.

        A rotation ψ changes a reading f = x + i y by −i ψ f, so the residual shows ψ = −Im(f* r)/|f|² with a weight of |f|². A
        constant and a linear rotation are left to the heading and to a housing that spins.
        """
        angle_rad, weight, time_s, total = _rotation_in_residual(context)
        count = int(MAX_GUESS_HZ * context.duration_s * FREQUENCIES_PER_CYCLE)
        tried_hz: Array = np.arange(2.0, count + 2.0) / (FREQUENCIES_PER_CYCLE * context.duration_s)
        drift = np.stack([np.ones_like(time_s), time_s], axis=1) * np.sqrt(weight)[:, None]
        basis = np.asarray(np.linalg.qr(drift)[0], dtype=np.float64)

        def without_drift(columns: Array) -> Array:
            return columns - basis @ (basis.T @ columns)

        target = without_drift(np.sqrt(weight) * angle_rad)
        gains, fitted = np.zeros(count), np.zeros((count, 2))
        for i, hz in enumerate(tried_hz):
            phase = 2 * np.pi * hz * time_s
            columns = without_drift(np.stack([np.cos(phase), np.sin(phase)], axis=1) * np.sqrt(weight)[:, None])
            fitted[i] = np.linalg.lstsq(columns, target, rcond=1e-9)[0]
            gains[i] = (columns @ fitted[i]) @ target
        best = int(np.argmax(gains))
        if gains[best] < MIN_GAIN * total:
            return []
        start_deg = np.degrees(fitted[best])
        return [{"frequency_hz": float(tried_hz[best]), "start_deg": (float(start_deg[0]), float(start_deg[1]))}]

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle of a damped oscillation."""
        angle, rate = (ca.pi / 180 * each for each in p["start_deg"])
        omega_t = 2 * ca.pi * p["frequency_hz"] * context.time_s
        damped = ca.sqrt(1 - p["damping_ratio"] ** 2) * omega_t
        return ca.exp(-p["damping_ratio"] * omega_t) * (angle * ca.cos(damped) + rate * ca.sin(damped))


def _rotation_in_residual(context: GuessContext) -> tuple[Array, Array, Array, float]:
    """Return binned rotations in rad, their weights and times, and the sum of squares of the residual beyond the noise."""
    predicted = context.force_g - context.residual_g
    figure, residual = (each[:, 0] + 1j * each[:, 1] for each in (predicted, context.residual_g))
    bins = np.floor(context.time_s / BIN_S).astype(np.int64)
    count = int(bins[-1]) + 1
    torque, weight, members, elapsed = (
        np.bincount(bins, each, count).astype(np.float64)
        for each in (-np.imag(np.conj(figure) * residual), np.abs(figure) ** 2, np.ones(len(bins)), context.time_s)
    )
    full = weight > 0
    noise = len(residual) * float((context.noise_g[:2] ** 2).sum())
    total = max(float((np.abs(residual) ** 2).sum()) - noise, 0.0)
    return torque[full] / weight[full], weight[full], elapsed[full] / members[full], total
