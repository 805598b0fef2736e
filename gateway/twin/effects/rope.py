"""What changes the rope's length, and what hangs below the hook."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from devices.pendulum.double_pendulum import modes
from devices.pendulum.equations import Scalar
from gateway.twin.effects.effect import (
    Effect,
    EvaluationContext,
    ModelStructure,
    Parameter,
    ParameterKind,
    RopeGeometry,
    Symbols,
    Values,
)
from gateway.twin.effects.event_guesses import guess_impact, guess_pulse
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.pulse import Pulse, duration, ramp_fraction, start
from gateway.twin.effects.spectral_guesses import guess_bounce, guess_double_pendulum

Length = tuple[Scalar, Scalar, Scalar]
MEASURE_ROPE = "measure the rope, or compare the recording's clock with another over some minutes"
MEASURE_HOUSING = (
    "turn the sensor upside down at rest: an offset keeps its sign, a scale error does not; measure the housing's place"
)
RECORD_DRIVES = "repeat the manoeuvre with the drives' own signals recorded, or with a second sensor at the pivot"
LONGEST_RIGGING = 0.95
"""Share of the believed length."""


def add_length(length: Length, by: Scalar, rate: Scalar = 0.0, acceleration: Scalar = 0.0) -> Length:
    """A length with its two derivatives, and something added to each."""
    return length[0] + by, length[1] + rate, length[2] + acceleration


class Hoisting(Effect):
    """The rope becomes longer or shorter."""

    name = "hoisting"
    equation = "L' = r' = v w(t; t₀, T, s), w rises as (1 − cos)/2 over s T/2, stays 1 and falls until t₀ + T"
    explains = "The load was hoisted or lowered; the housing, clamped to the rope, moves with it."
    reference = "conservation of angular momentum as the rope's length changes"
    enters = "rope"
    discriminating_experiment = RECORD_DRIVES
    transient = True
    changes_length = True
    profile_modelled = False
    """How a winch starts and stops is its own."""
    parameters = (
        Parameter(
            "speed_m_s", "m/s", "lowering; hoisting is negative", -2.0, 2.0, 0.0, 0.01, -0.2, operator_sigma=5e-3
        ),
        start(30.0, operator_sigma=1.0),
        duration(8.0, operator_sigma=0.2),
        ramp_fraction(0.1),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """From changepoint to changepoint, and as long as the windows; with soft edges and with sharp ones."""
        return guess_pulse(context)

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Where the winch starts, runs, slows and stands."""
        return self._pulse(p).edges

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """The housing keeps its distance to the load."""
        winch, speed = self._pulse(p), p["speed_m_s"]
        by = (speed * winch.area(now), speed * winch.value(now), speed * winch.slope(now))
        return RopeGeometry(add_length(ropes.length, *by), add_length(ropes.position, *by))

    @staticmethod
    def _pulse(p: Symbols) -> Pulse:
        return Pulse(p["start_s"], p["duration_s"], p["rising_share"])


class RopeLength(Effect):
    """The rope is not as long as believed."""

    name = "rope_length"
    equation = "L = L_believed (1 + e)"
    explains = "The rope is longer or shorter than the rig's description says."
    reference = "period ~ √(L/g)"
    enters = "rope"
    discriminating_experiment = MEASURE_ROPE
    scales_period = True
    length_like = True
    parameters = (Parameter("relative_error", "1", "e", -0.5, 1.0, 0.0, 1e-3, 0.02, prior_sigma=0.05),)

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """All of the length in proportion; the housing stays where it was measured."""
        length, rate, acceleration = ropes.length
        return replace(ropes, length=(length * (1 + p["relative_error"]), rate, acceleration))


class RopeStretch(Effect):
    """The load bounces on the rope."""

    name = "rope_stretch"
    equation = "L = L_believed + u, r = r_believed + h u, u = q g/ω² + s; s'' = L |n'|² + n·d − g − ω² s − 2 ζ ω s'"
    explains = "The load bounces up and down on an elastic rope."
    reference = "spring and mass along the rope, coupled to the swing by the rope's tension"
    enters = "structure"
    linear_at_neutral = False
    structure = ModelStructure.ELASTIC
    steady_frequency = True
    parameters = (
        Parameter(
            "frequency_hz",
            "Hz",
            "of the bounce, ω/2π",
            0.3,
            20.0,
            2.0,
            0.01,
            2.0,
            kind=ParameterKind.FREQUENCY,
            step_limit=0.05,
        ),
        Parameter(
            "damping_ratio", "1", "ζ of the bounce; a rope without any does not exist", 1e-3, 0.5, 0.01, 1e-3, 0.01
        ),
        Parameter("above_housing", "1", "h, part of the stretch that is above the housing", 0.0, 1.0, 1.0, 0.01, 1.0),
        Parameter(
            "sag_unknown", "1", "q, part of the sag under the load that the belief lacks", 0.0, 1.0, 1.0, 0.01, 1.0
        ),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the strongest line of the axial residual, if it stands out."""
        return guess_bounce(context)

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """An eighth of a radian of the bounce."""
        return 0.125 / (2 * ca.pi * p["frequency_hz"])

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """The load hangs lower by the sag under its weight and bounces about it; the housing takes its part in both."""
        sag = p["sag_unknown"] * now.gravity_m_s2 / (2 * ca.pi * p["frequency_hz"]) ** 2
        stretch, rate, acceleration = now.stretch
        part = p["above_housing"]
        return RopeGeometry(
            add_length(ropes.length, sag + stretch, rate, acceleration),
            add_length(ropes.position, part * (sag + stretch), part * rate, part * acceleration),
        )

    def stretch_m_s2(self, p: Symbols, now: EvaluationContext, beyond_rest_m_s2: Scalar) -> Scalar:
        """A damped spring."""
        omega, (stretch, rate, _) = 2 * ca.pi * p["frequency_hz"], now.stretch
        return beyond_rest_m_s2 - omega**2 * stretch - 2 * p["damping_ratio"] * omega * rate


class LoadChange(Effect):
    """The load's centre moves."""

    name = "load_change"
    equation = "L = L₀ + ΔL for t ≥ t₀"
    explains = "A load was picked up, set down or partly lost: the centre of what hangs there moved along the rope."
    reference = "a point load's mass has no effect on its swing; the place of its centre has"
    enters = "rope"
    transient = True
    changes_length = True
    instantaneous = True
    parameters = (
        Parameter(
            "length_change_m", "m", "by which the load's centre moves away from the pivot", -10.0, 10.0, 0.0, 0.01, -0.5
        ),
        start(30.0),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the changepoint, and in the middle of the short windows."""
        return guess_impact(context)

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """The instant of the change."""
        return (p["start_s"],)

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """Longer from an edge on; rope and housing stay."""
        return replace(ropes, length=add_length(ropes.length, p["length_change_m"] * now.step_at(p["start_s"])))


class DoublePendulum(Effect):
    """A hook block with weight, and rigging below it."""

    name = "double_pendulum"
    equation = "two ropes, L − l and l, coupled by the rigging's tension at a hook of mass M = q m"
    explains = "The load hangs by long rigging below a heavy hook block: it swings in two modes."
    reference = "ω² = (g/2)[(1+R)(1/L₁+1/L₂) ± √((1+R)²(1/L₁+1/L₂)² − 4(1+R)/(L₁L₂))], R = 1/q"
    enters = "structure"
    linear_at_neutral = False
    structure = ModelStructure.RIGGING
    slow_convergence = True
    segment_s = 8.0
    """Two modes beat: a fit that starts off their frequencies follows them only for so long."""
    parameters = (
        Parameter("rigging_length_m", "m", "l, hook to the load's centre", 0.2, 100.0, 4.0, 0.05, 4.0),
        Parameter("hook_mass_ratio", "1", "q, hook block over load", 0.005, 5.0, 0.1, 0.01, 0.1),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """Riggings and hooks whose modes have the frequencies of the two main lines."""
        return guess_double_pendulum(context)

    def upper_bound(self, parameter: Parameter, length_m: float) -> float:
        """The rigging is part of the believed length."""
        longest_m = LONGEST_RIGGING * length_m
        return min(parameter.upper, longest_m) if parameter.name == "rigging_length_m" else parameter.upper

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """A tenth of a radian of the fast mode, which may go on for long."""
        lower_m = p["rigging_length_m"]
        return 0.1 / modes(length_m - lower_m, lower_m, p["hook_mass_ratio"], gravity_m_s2)[1].rate

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """The upper rope ends at the hook."""
        return replace(ropes, length=add_length(ropes.length, -p["rigging_length_m"]))
