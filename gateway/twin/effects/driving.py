"""Forces that drive the load or take energy out of its swing, and motion of the pivot."""

import numpy as np

from devices.pendulum.equations import Scalar, Vector, scale
from gateway.twin.effects.effect import LARGER_SWING, RECORD_DRIVES, TURN_HOUSING, Effect
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext
from gateway.twin.effects.guess_context import SHARPEST, GuessContext, guess_trapezoid
from gateway.twin.effects.parameter import Symbols, Values, amplitude
from gateway.twin.effects.pulse import Pulse, PulseEffect, duration, ramp_fraction, start

HORIZONTAL = ("x", "y")


def horizontal(components: tuple[Scalar, Scalar], factor: Scalar = 1.0) -> Vector:
    """Return a horizontal vector with these components, scaled."""
    return factor * components[0], factor * components[1], 0.0


class SteadyWind(Effect):
    """A constant horizontal force."""

    name = "steady_wind"
    equation = "F/m = (a_x, a_y, 0)"
    explains = (
        "A steady side pull, by wind on the load or by a tag line: the rope leans and the load swings about the lean."
    )
    reference = "statics: lean = arctan(a/g)"
    enters = "force on the load"
    discriminating_experiment = TURN_HOUSING
    world_directed = True
    parameters = (
        amplitude("accel_m_s2", "m/s²", "a, force over the load's mass", (-2.0, 2.0), (0.2, 0.0), HORIZONTAL),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the constant force."""
        return horizontal(p["accel_m_s2"])


class WindGust(PulseEffect):
    """A horizontal force with the shape of a pulse."""

    name = "wind_gust"
    equation = "F/m = (a_x, a_y, 0) w(t; t₀, T, s), w rises as (1 − cos)/2 during s T/2, stays 1 and falls until t₀ + T"
    explains = "A gust, or a pull on the load for some seconds."
    reference = "s = 1: the one-minus-cosine gust of EN 61400-1 and CS 25.341; s → 0: a pull with sharp edges"
    enters = "force on the load"
    discriminating_experiment = RECORD_DRIVES
    world_directed = True
    min_duration_s = 0.5
    """A shorter push is an impact."""
    parameters = (
        amplitude("accel_m_s2", "m/s²", "a, force over the load's mass", (-5.0, 5.0), (0.25, 0.1), HORIZONTAL),
        start(30.0),
        duration(5.0),
        ramp_fraction(1.0),
    )

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return an eighth of the duration."""
        return p["duration_s"] / 8

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force of the pulse."""
        return horizontal(p["accel_m_s2"], self.pulse(p).value(context))


class Impact(Effect):
    """An impulse on the load."""

    name = "impact"
    equation = "v⁺ = v⁻ + (Δv_x, Δv_y, 0) at t₀"
    explains = "Something struck the load, or the load struck something."
    reference = "impulse over the load's mass; the rope takes the component along it"
    enters = "force on the load"
    discriminating_experiment = RECORD_DRIVES
    transient = True
    world_directed = True
    instantaneous = True
    profile_modelled = False
    """A real impact lasts some hundredths of a second."""
    parameters = (amplitude("delta_v_m_s", "m/s", "jump of velocity", (-5.0, 5.0), (0.2, 0.1), HORIZONTAL), start(30.0))

    def velocity_jump_m_s(self, p: Symbols) -> Vector:
        """Return the jump of the velocity."""
        return horizontal(p["delta_v_m_s"])


class TrolleyAcceleration(Effect):
    """The pivot accelerates, moves at constant speed, and decelerates."""

    name = "trolley_acceleration"
    equation = "a_p = (a_x, a_y, 0) (w(t; t₀, T, s) − w(t; t₀ + T + T_c, T, s)), w as of a gust"
    explains = "The trolley or the bridge was driven."
    reference = "trapezoidal speed profile of a drive"
    enters = "pivot"
    discriminating_experiment = RECORD_DRIVES
    transient = True
    world_directed = True
    parameters = (
        amplitude("accel_m_s2", "m/s²", "a, acceleration of the pivot", (-2.0, 2.0), (0.2, 0.1), HORIZONTAL),
        start(30.0),
        duration(3.0, meaning="T, duration of each of the two ramps"),
        duration(5.0, "coast_s", "T_c, time at constant speed"),
        ramp_fraction(SHARPEST),
    )

    def interval_s(self, values: Values) -> tuple[float, float]:
        """Return the time from the first ramp to the end of the second."""
        start_s, ramp_s, coast_s = (float(np.asarray(values[key])) for key in ("start_s", "duration_s", "coast_s"))
        return start_s, start_s + 2 * ramp_s + coast_s

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return drives with short and with long ramps between the changepoints, and one in each window."""
        return guess_trapezoid(context)

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Return those of both ramps."""
        accelerating, decelerating = self._ramps(p)
        return *accelerating.discontinuities_s, *decelerating.discontinuities_s

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the acceleration of the two ramps."""
        accelerating, decelerating = self._ramps(p)
        return horizontal(p["accel_m_s2"], accelerating.value(context) - decelerating.value(context))

    @staticmethod
    def _ramps(p: Symbols) -> tuple[Pulse, Pulse]:
        start_s, ramp_s, fraction = p["start_s"], p["duration_s"], p["rising_share"]
        return Pulse(start_s, ramp_s, fraction), Pulse(start_s + ramp_s + p["coast_s"], ramp_s, fraction)


class ViscousDamping(Effect):
    """Force proportional to the velocity; the amplitude decays as A' = -c A/2, c = 2 zeta sqrt(g/L)."""

    name = "viscous_damping"
    equation = "F/m = −2 ζ √(g/L) v"
    explains = "The swing loses the same fraction in each period: losses in the rope, the sheaves and the joints."
    reference = "viscous damping, Inman 2014, section 1.3: A′ = −c A/2, c = 2 ζ √(g/L)"
    enters = "force on the load"
    dissipative = True
    discriminating_experiment = LARGER_SWING
    parameters = (amplitude("damping_ratio", "1", "ζ, fraction of critical damping", (0.0, 0.5), 5e-3),)

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return a force against the velocity."""
        return scale(-2 * p["damping_ratio"] * load.small_swing_rate_1_s, load.velocity_m_s)


class QuadraticDrag(Effect):
    """Force proportional to the square of the speed; the amplitude decays as A' = -(4/3 pi) k L w A^2."""

    name = "quadratic_drag"
    equation = "F/m = −k |v| v"
    explains = "Large swings die away faster than small ones: air drag on a large, light load."
    reference = "drag law, k = ρ_air c_d A/(2 m); by the work in one period: A′ = −(4/3π) k L ω A²"
    enters = "force on the load"
    dissipative = True
    discriminating_experiment = LARGER_SWING
    parameters = (amplitude("drag_per_m", "1/m", "k, drag coefficient over mass", (0.0, 1.0), 5e-3),)

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return a force against the velocity."""
        return scale(-p["drag_per_m"] * load.speed_m_s, load.velocity_m_s)


class CoulombFriction(Effect):
    """Force of constant magnitude against the velocity; the amplitude decays as A' = -2 mu/(pi w L)."""

    name = "coulomb_friction"
    equation = "F/m = −μ v/|v|"
    explains = "Small swings die away faster than large ones and come to a stop: dry friction at the pivot."
    reference = "Coulomb friction, Inman 2014, section 1.10: A′ = −2 μ/(π ω L)"
    enters = "force on the load"
    dissipative = True
    discriminating_experiment = LARGER_SWING
    parameters = (amplitude("decel_m_s2", "m/s²", "μ, friction force over mass", (0.0, 0.5), 4e-3),)

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return a force against the velocity, of a magnitude that does not depend on it."""
        return scale(-p["decel_m_s2"], load.direction_of_motion(p["decel_m_s2"]))
