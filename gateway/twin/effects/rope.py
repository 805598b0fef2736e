"""The length and the elasticity of the rope, and rigging below a hook block."""

import casadi as ca

from devices.pendulum.double_pendulum import modes
from devices.pendulum.equations import Scalar
from gateway.numerics.spectrum import find_strongest_line
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.evaluation_context import EvaluationContext, Rigging, RopeGeometry
from gateway.twin.effects.experiments import MEASURE_ROPE, RECORD_DRIVES
from gateway.twin.effects.guess_context import GuessContext, guess_double_pendulum
from gateway.twin.effects.parameter import Parameter, ParameterKind, Symbols, Values, amplitude, shape
from gateway.twin.effects.pulse import PulseEffect, duration, ramp_fraction, start

MAX_RIGGING_SHARE = 0.95
"""Longest rigging over the nominal length. Basis: a choice; the upper rope needs some length, too."""
MAX_FAST_MODE_STEP_RAD = 0.1
"""Phase of the fast mode of a double pendulum in one integration step; the mode may go on for long."""
BOUNCE_HZ = (0.5, 8.0)
"""Band of the oscillation of loads along their ropes."""
MIN_BOUNCE_POWER = 30.0
"""Power of an oscillation along the rope over the noise floor around it. Basis: a choice; it decays, so its line is broad and
low, and a third of that of an evident line."""
MAX_BOUNCE_STEP_RAD = 0.125
"""Phase of the oscillation along the rope in one integration step."""


class Hoisting(PulseEffect):
    """A change of the rope's length by the winch."""

    name = "hoisting"
    equation = "L′ = r′ = v w(t; t₀, T, s), w rises as (1 − cos)/2 during s T/2, stays 1 and falls until t₀ + T"
    explains = "The load was hoisted or lowered; the housing, clamped to the rope, moves with it."
    reference = "conservation of angular momentum as the rope's length changes"
    enters = "rope"
    discriminating_experiment = RECORD_DRIVES
    changes_length = True
    profile_modelled = False
    """The speed of a real winch follows its own profile."""
    parameters = (
        amplitude("speed_m_s", "m/s", "v, positive for lowering", (-2.0, 2.0), -0.2, operator_sigma=5e-3),
        start(30.0, operator_sigma=1.0),
        duration(8.0, operator_sigma=0.2),
        ramp_fraction(0.1),
    )

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Change both distances: the housing keeps its distance to the load."""
        pulse, speed = self.pulse(p), p["speed_m_s"]
        change = speed * pulse.integral(context), speed * pulse.value(context), speed * pulse.slope(context)
        return geometry.with_changes(change, change)


class RopeLength(Effect):
    """An error of the nominal length of the rope."""

    name = "rope_length"
    equation = "L = L_nominal (1 + e)"
    explains = "The rope is longer or shorter than the rig's description says."
    reference = "period of a small swing: 2π √(L/g)"
    enters = "rope"
    discriminating_experiment = MEASURE_ROPE
    scales_period = True
    length_like = True
    in_every_rig = True
    parameters = (amplitude("relative_error", "1", "e", (-0.5, 1.0), 0.02, prior_sigma=0.05),)

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Scale the length; the housing stays where it was measured, from the pivot or from the load."""
        added = geometry.length[0] * p["relative_error"]
        return geometry.with_changes((added,), (added,) if geometry.is_placed_from_load else ())


class RopeStretch(Effect):
    """An oscillation of the load along an elastic rope."""

    name = "rope_stretch"
    equation = "L = L_nominal + u, r = r_nominal + h u, u = q g/ω² + s; s″ = L |n′|² + n·d − g − ω² s − 2 ζ ω s′"
    explains = "The load bounces up and down on an elastic rope."
    reference = "spring and mass along the rope, coupled to the swing by the rope's tension; d = g − a_p + F/m"
    enters = "structure"
    linear_at_neutral = False
    structure = ModelStructure.ELASTIC
    steady_frequency = True
    parameters = (
        shape(
            "frequency_hz",
            "Hz",
            "of the oscillation, ω/2π",
            (0.3, 20.0),
            2.0,
            kind=ParameterKind.FREQUENCY,
            step_limit=0.05,
        ),
        shape("damping_ratio", "1", "ζ of the oscillation; no rope is without damping", (1e-3, 0.5), 0.01),
        shape("above_housing", "1", "h, fraction of the stretch above the housing", (0.0, 1.0), 1.0),
        shape(
            "sag_unknown",
            "1",
            "q, fraction of the elongation under the load that the nominal length lacks",
            (0.0, 1.0),
            1.0,
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the frequency of the strongest line of the axial residual, if it stands out."""
        axial = context.residual_g * [0.0, 0.0, 1.0] / context.noise_g
        line = find_strongest_line(context.time_s, axial, *BOUNCE_HZ)
        return [] if line is None or line.power[2] < MIN_BOUNCE_POWER else [{"frequency_hz": line.frequency_hz}]

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return an eighth of a radian of the oscillation."""
        return MAX_BOUNCE_STEP_RAD / self._angular_frequency(p)

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Lengthen the rope by the elongation under the load's weight and by the stretch beyond it."""
        elongation = p["sag_unknown"] * context.gravity_m_s2 / self._angular_frequency(p) ** 2
        stretch, rate, acceleration = context.stretch
        above, longer = p["above_housing"], elongation + stretch
        return geometry.with_changes((longer, rate, acceleration), (above * longer, above * rate, above * acceleration))

    def stretch_acceleration_m_s2(self, p: Symbols, context: EvaluationContext, excess_pull_m_s2: Scalar) -> Scalar:
        """Return the acceleration of a damped spring."""
        omega, (stretch, rate, _) = self._angular_frequency(p), context.stretch
        return excess_pull_m_s2 - omega**2 * stretch - 2 * p["damping_ratio"] * omega * rate

    @staticmethod
    def _angular_frequency(p: Symbols) -> Scalar:
        return 2 * ca.pi * p["frequency_hz"]


class LoadChange(Effect):
    """A sudden change of the distance from the pivot to the centre of the load."""

    name = "load_change"
    equation = "L = L₀ + ΔL for t ≥ t₀"
    explains = "A load was picked up, set down or partly lost: the centre of what hangs there moved along the rope."
    reference = (
        "the swing of a point load does not depend on its mass, but on the distance of its centre from the pivot"
    )
    enters = "rope"
    transient = True
    changes_length = True
    instantaneous = True
    parameters = (
        amplitude("length_change_m", "m", "ΔL, positive if the centre moves away from the pivot", (-10.0, 10.0), -0.5),
        start(30.0),
    )

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Change the length from the start on; rope and housing stay."""
        change = p["length_change_m"] * context.step_at(p["start_s"])
        return geometry.with_changes((change,), ())


class DoublePendulum(Effect):
    """Rigging below a hook block with mass."""

    name = "double_pendulum"
    equation = "two ropes, L − l and l, coupled by the rigging's tension at a hook of mass M = q m"
    explains = "The load hangs by long rigging below a heavy hook block: it swings in two modes."
    reference = "Singhose et al. 2008: ω² = (g/2)[(1+R)(1/L₁+1/L₂) ± √((1+R)²(1/L₁+1/L₂)² − 4(1+R)/(L₁L₂))], R = 1/q"
    enters = "structure"
    linear_at_neutral = False
    structure = ModelStructure.RIGGING
    slow_convergence = True
    segment_s = 8.0
    """Two modes beat: a fit that starts from wrong frequencies follows them only for so long."""
    parameters = (
        shape("rigging_length_m", "m", "l, from the hook to the load's centre", (0.2, 100.0), 4.0),
        shape("hook_mass_ratio", "1", "q, mass of the hook block over that of the load", (0.005, 5.0), 0.1),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return rigging lengths and hook masses whose modes have the frequencies of the two main lines."""
        return guess_double_pendulum(context)

    def upper_bound(self, parameter: Parameter, length_m: float) -> float:
        """Limit the rigging to a part of the nominal length."""
        longest_m = MAX_RIGGING_SHARE * length_m
        return min(parameter.upper, longest_m) if parameter.name == "rigging_length_m" else parameter.upper

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return a tenth of a radian of the fast mode."""
        lower_m = p["rigging_length_m"]
        return MAX_FAST_MODE_STEP_RAD / modes(length_m - lower_m, lower_m, p["hook_mass_ratio"], gravity_m_s2)[1].rate

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Let the upper rope end at the hook."""
        return geometry.with_changes((-p["rigging_length_m"],), ())

    def rigging(self, p: Symbols) -> Rigging:
        """Return the rigging below the hook."""
        return Rigging(p["rigging_length_m"], p["hook_mass_ratio"])
