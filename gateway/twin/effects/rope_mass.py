"""The mass of the rope, with a guess of it from the ringing of its string mode, and the load as a body with inertia."""

import math
from dataclasses import replace

import numpy as np

from devices.pendulum.equations import Scalar
from devices.pendulum.heavy_rope import HeavyRope
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.numerics.spectrum import find_strongest_line, fit_sine_phasors
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.evaluation_context import EvaluationContext, RopeGeometry
from gateway.twin.effects.experiments import MEASURE_TO_CENTRE, WEIGH_LOAD
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Symbols, Values, amplitude, shape
from gateway.twin.effects.rope import RopeLength

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
            "radius_of_gyration_m",
            "m",
            "k, radius of gyration about a horizontal axis through the load's centre",
            (0.0, 100.0),
            1.0,
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
        rope = self._rope(p, gravity_m_s2, RopeGeometry((length_m, 0.0, 0.0), (0.0, 0.0, 0.0)))
        return MAX_STRING_STEP_RAD / rope.string_rate

    def heavy_rope(self, p: Symbols, gravity_m_s2: float, geometry: RopeGeometry) -> HeavyRope:
        """Return the rope; hoisting changes its mass."""
        return self._rope(p, gravity_m_s2, geometry)

    def equivalent_values(self, coincident: Values, length_m: float) -> Values | None:
        """Return λ of the period of a length that seems shorter by the share −e: (1 + μ/3)/(1 + μ/2) = 1 + e."""
        error = float(np.asarray(coincident["relative_error"]))
        if not MAX_SHORTENING < error < 0:
            return None
        return {"relative_density_1_m": -6 * error / (1 + 3 * error) / length_m}

    @staticmethod
    def _rope(p: Symbols, gravity_m_s2: float, geometry: RopeGeometry) -> HeavyRope:
        length, rate, _ = geometry.length
        density, damping = p["relative_density_1_m"], p["string_damping_ratio"]
        return HeavyRope(length, rate, density * length, damping, gravity_m_s2, geometry.gyration_squared_m2)
