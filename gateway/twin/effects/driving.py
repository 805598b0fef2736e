"""What pushes the load or moves the pivot."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import BodyState, Effect, EvaluationContext, Parameter, Symbols, Values
from gateway.twin.effects.event_guesses import guess_gust, guess_impact, guess_trapezoid
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.pulse import Pulse, duration, ramp_fraction, start
from gateway.twin.effects.pulse_shape import SHARPEST

HORIZONTAL = ("x", "y")
TURN_HOUSING = (
    "turn the housing about the rope by 90 degrees and record again: what stays with the sensor is offset, mount or "
    "cross-axis sensitivity, what turns is wind; a wider swing separates a tilt from an offset"
)
RECORD_DRIVES = "repeat the manoeuvre with the drives' own signals recorded, or with a second sensor at the pivot"


def horizontal(p: Any, factor: Scalar) -> Vector:
    """A horizontal vector, scaled."""
    return factor * p[0], factor * p[1], 0.0


class SteadyWind(Effect):
    """A lean that stays."""

    name = "steady_wind"
    equation = "F/m = (a_x, a_y, 0)"
    explains = "A steady side pull: wind on the load, or a tag line; the rope leans and swings about the lean."
    reference = "statics: lean = arctan(a/g)"
    enters = "force on the load"
    discriminating_experiment = TURN_HOUSING
    world_directed = True
    parameters = (
        Parameter("accel_m_s2", "m/s²", "force over the load's mass", -2.0, 2.0, 0.0, 0.01, (0.2, 0.0), HORIZONTAL),
    )

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """The same always."""
        return horizontal(p["accel_m_s2"], 1.0)


class WindGust(Effect):
    """A push that lasts for a time."""

    name = "wind_gust"
    equation = "F/m = (a_x, a_y, 0) w(t; t₀, T, s), w rises as (1 − cos)/2 over s T/2, stays 1 and falls until t₀ + T"
    explains = "A gust, or a pull on the load for some seconds."
    reference = (
        "s = 1: the one-minus-cosine gust of load standards (EN 61400-1, CS 25.341); s → 0: a pull with sharp edges"
    )
    enters = "force on the load"
    discriminating_experiment = RECORD_DRIVES
    transient = True
    world_directed = True
    min_duration_s = 0.5
    """A push that lasts for less is an impact."""
    parameters = (
        Parameter("accel_m_s2", "m/s²", "force over the load's mass", -5.0, 5.0, 0.0, 0.01, (0.25, 0.1), HORIZONTAL),
        start(30.0),
        duration(5.0),
        ramp_fraction(1.0),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """Between the changepoints, and longer about the windows' middles: a gust swells and dies away."""
        return guess_gust(context)

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Where it starts, is full, falls and ends."""
        return self._pulse(p).edges

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Eight steps at least."""
        return p["duration_s"] / 8

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """Rises to the full force, stays, and falls again."""
        return horizontal(p["accel_m_s2"], self._pulse(p).value(now))

    @staticmethod
    def _pulse(p: Symbols) -> Pulse:
        return Pulse(p["start_s"], p["duration_s"], p["rising_share"])


class Impact(Effect):
    """A blow."""

    name = "impact"
    equation = "v⁺ = v⁻ + (Δv_x, Δv_y, 0) at t₀"
    explains = "Something struck the load, or the load struck something."
    reference = "impulse over the load's mass; the rope takes the part along it"
    enters = "force on the load"
    discriminating_experiment = RECORD_DRIVES
    transient = True
    world_directed = True
    instantaneous = True
    profile_modelled = False
    """What strikes the load gives way for some hundredths of a second."""
    parameters = (
        Parameter("delta_v_m_s", "m/s", "jump of velocity", -5.0, 5.0, 0.0, 0.01, (0.2, 0.1), HORIZONTAL),
        start(30.0),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the changepoint, and in the middle of the short windows."""
        return guess_impact(context)

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """The instant of the blow."""
        return (p["start_s"],)

    def velocity_jump_m_s(self, p: Symbols) -> Vector:
        """The jump."""
        return horizontal(p["delta_v_m_s"], 1.0)


class TrolleyAcceleration(Effect):
    """The pivot speeds up, runs on, slows down."""

    name = "trolley_acceleration"
    equation = "a_p = (a_x, a_y, 0) (w(t; t₀, T, s) − w(t; t₀ + T + T_c, T, s)), w as of a gust"
    explains = "The trolley or the bridge was driven."
    reference = "trapezoidal speed profile of a drive"
    enters = "pivot"
    discriminating_experiment = RECORD_DRIVES
    transient = True
    world_directed = True
    parameters = (
        Parameter("accel_m_s2", "m/s²", "of the pivot", -2.0, 2.0, 0.0, 0.01, (0.2, 0.1), HORIZONTAL),
        start(30.0),
        duration(3.0),
        duration(5.0, "coast_s"),
        ramp_fraction(SHARPEST),
    )

    def interval_s(self, values: Values) -> tuple[float, float]:
        """From speeding up to the end of slowing down: two ramps and the run between them."""
        start_s, ramp_s, coast_s = (float(np.asarray(values[key])) for key in ("start_s", "duration_s", "coast_s"))
        return start_s, start_s + 2 * ramp_s + coast_s

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """Two ramps at the ends: short and long ones between the changepoints, middling ones in the windows."""
        return guess_trapezoid(context)

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Of speeding up and of slowing down."""
        speeding, slowing = self._pulses(p)
        return *speeding.edges, *slowing.edges

    def pivot_m_s2(self, p: Symbols, now: EvaluationContext) -> Vector:
        """Constant on each ramp but for its rise and fall."""
        speeding, slowing = self._pulses(p)
        return horizontal(p["accel_m_s2"], speeding.value(now) - slowing.value(now))

    @staticmethod
    def _pulses(p: Symbols) -> tuple[Pulse, Pulse]:
        begin, ramp, share = p["start_s"], p["duration_s"], p["rising_share"]
        return Pulse(begin, ramp, share), Pulse(begin + ramp + p["coast_s"], ramp, share)
