"""The rope: its length, elasticity and mass, rigging below a hook block, and the load as a body with inertia."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np

from devices.pendulum.double_pendulum import modes
from devices.pendulum.equations import Scalar
from devices.pendulum.heavy_rope import HeavyRope
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.numerics.spectrum import find_strongest_line, fit_sine_phasors
from gateway.twin.effects.effect import (
    MEASURE_ROPE,
    MEASURE_TO_CENTRE,
    RECORD_DRIVES,
    WEIGH_LOAD,
    Effect,
    ModelStructure,
)
from gateway.twin.effects.evaluation_context import EvaluationContext, Rigging, RopeGeometry
from gateway.twin.effects.guess_context import GuessContext, guess_double_pendulum
from gateway.twin.effects.parameter import Parameter, Symbols, Values, amplitude, frequency, shape
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
        frequency("of the oscillation, ω/2π", (0.3, 20.0), 2.0, step_limit=0.05),
        shape("damping_ratio", "1", "ζ of the oscillation; no rope is without damping", (1e-3, 0.5), 0.01),
        shape("above_housing", "1", "h, fraction of the stretch above the housing", (0.0, 1.0), 1.0),
        shape("sag_unknown", "1", "q, share of the load's elongation that the nominal length lacks", (0.0, 1.0), 1.0),
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


STRING_BAND = (4.5, 40.0)
"""Range of the string mode over the swing, above its strong harmonics. Basis: ropes of 0.6 and 0.007 of the load's mass."""
MAX_STRING_HZ = 8.0
RINGING_S = 20.0
"""Part of the recording in which the string mode is searched. Basis: a choice; it dies away in some seconds."""
MIN_STRING_POWER = 60.0
"""Power of the string mode's line over the noise floor around it."""
MAX_REMAINING = 0.6
"""Amplitude of the line in the last part of the recording over that in the first. Basis: a choice; above it is no free
vibration."""
MAX_MASS_RATIO = 1.5
MAX_SHORTENING = -1 / 3
"""Change of the equivalent length with a rope alone, without a load. Definition: a uniform rope swings like a pendulum of two
thirds of its length."""
MAX_STRING_STEP_RAD = 0.25
"""Phase of the string mode in one integration step; the mode dies away in some seconds."""


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
        amplitude(
            "radius_of_gyration_m", "m", "k, about a horizontal axis through the load's centre", (0.0, 100.0), 1.0
        ),
    )

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Give the load its inertia; the distances to its centre and to the housing stay."""
        return replace(geometry, gyration_squared_m2=p["radius_of_gyration_m"] ** 2)

    def equivalent_values(self, coincident: Values, length_m: float) -> Values | None:
        """Return k = L √e of a length that seems longer by the share e."""
        relative_error = float(np.asarray(coincident["relative_error"]))
        return {"radius_of_gyration_m": length_m * math.sqrt(relative_error)} if relative_error > 0 else None


def guess_mass_ratio(context: GuessContext) -> float | None:
    """Return the rope's mass over the load's that gives the string mode the frequency of the line that dies away."""
    across = context.residual_g * [1.0, 1.0, 0.0] / context.noise_g
    early, late = context.time_s < RINGING_S, context.time_s > context.duration_s - RINGING_S
    nominal_hz = small_swing_rate_1_s(context.length_m, context.gravity_m_s2) / (2 * np.pi)
    from_hz, to_hz = (each * nominal_hz for each in STRING_BAND)
    line = find_strongest_line(context.time_s[early], across[early], from_hz, min(to_hz, MAX_STRING_HZ))
    if line is None or float(line.power[:2].sum()) < MIN_STRING_POWER:
        return None
    first, last = (
        float(np.linalg.norm(fit_sine_phasors(context.time_s[part], across[part], line.frequency_hz)))
        for part in (early, late)
    )
    if last > MAX_REMAINING * first:
        return None
    ratio = 0.0
    for _ in range(20):  # the mode's rate times the root of the ratio is constant, but for a few per cent
        rope = HeavyRope(context.length_m, 0.0, max(ratio, 1e-3), 0.0, context.gravity_m_s2)
        ratio = rope.mass_ratio * (rope.string_rate / (2 * np.pi * line.frequency_hz)) ** 2
    return ratio if ratio < MAX_MASS_RATIO else None


class RopeMass(Effect):
    """The mass of a heavy rope beside that of the load: a quicker swing, a sagging rope and its first mode as a string."""

    name = "rope_mass"
    equation = "two shapes of the rope, x L n + w sin(π x); f₁ ≈ √(g/(4 μ L)), ω² ≈ (g/L)(1 + μ/6), μ = λ L"
    explains = (
        "The rope is heavy beside the load: it swings a little faster than its length says, sags as it swings, and rings as a "
        "string after a release or a blow."
    )
    reference = "hanging string with a load, Routh 1905; two shapes by Galerkin's method, Inman 2014, section 8.2"
    enters = "structure"
    discriminating_experiment = WEIGH_LOAD
    linear_at_neutral = False
    structure = ModelStructure.HEAVY_ROPE
    coincides_with = RopeLength.name
    parameters = (
        shape(
            "relative_density_1_m",
            "1/m",
            "λ, mass of all parts of line in a metre of length over that of the load",
            (1e-5, 10.0),
            5e-3,
        ),
        shape("string_damping_ratio", "1", "ζ of the string mode; no rope is without damping", (1e-3, 0.5), 0.02),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the density that gives the string mode its frequency; none if nothing rings."""
        ratio = guess_mass_ratio(context)
        return [] if ratio is None else [{"relative_density_1_m": ratio / context.length_m}]

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return a quarter of a radian of the string mode."""
        rope = self.heavy_rope(p, gravity_m_s2, RopeGeometry((length_m, 0.0, 0.0), (0.0, 0.0, 0.0)))
        return MAX_STRING_STEP_RAD / rope.string_rate

    def heavy_rope(self, p: Symbols, gravity_m_s2: float, geometry: RopeGeometry) -> HeavyRope:
        """Return the rope; hoisting changes its mass."""
        length, rate, _ = geometry.length
        density, damping = p["relative_density_1_m"], p["string_damping_ratio"]
        return HeavyRope(length, rate, density * length, damping, gravity_m_s2, geometry.gyration_squared_m2)

    def equivalent_values(self, coincident: Values, length_m: float) -> Values | None:
        """Return λ of the period of a length that seems shorter by the share −e: (1 + μ/3)/(1 + μ/2) = 1 + e."""
        error = float(np.asarray(coincident["relative_error"]))
        if not MAX_SHORTENING < error < 0:
            return None
        return {"relative_density_1_m": -6 * error / (1 + 3 * error) / length_m}
