"""The structure that carries the pivot, as far as it yields, and a guess of it from the shape of the swing's ellipse.

The swing of x and y at one frequency is a polarised oscillation. Its shape is a point on a sphere, the normalised Stokes vector
(Born and Wolf 1999, section 1.4). A rotation of the figure, whatever its cause, moves the point about the axis s₃; periods that
differ between two directions move it about an axis in the plane of s₁ and s₂, and so turn an ellipse into a line and back.
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Vector, add, cross, dot, scale
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.numerics.spectrum import find_strongest_line, fit_sine_phasors
from gateway.twin.effects.effect import SWING_BOTH_WAYS, SWING_TO_REST, Effect, ModelStructure
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Symbols, Values, amplitude, shape

Array = NDArray[np.float64]
TINY = 1e-30
PERIODS_PER_WINDOW = 3.0
"""Swings from which one shape is estimated."""
MIN_WINDOWS = 4
BAND = (0.6, 1.5)
"""Range of the swing's frequency over that of the nominal rope."""
MIN_TURN_RAD = 0.1
"""Least turn of the Stokes vector in the recording beyond the model's. Basis: a compliance of 0.2 % of the rope in twenty
swings."""
MAX_UNEXPLAINED = 0.25
"""Share of the departure from the model's shape that a constant difference of two periods may leave unexplained."""
MIN_REVERSAL_RAD = 0.04
"""Phase of a small swing that a reversal of the friction takes at least. Basis: a contact that follows faster needs shorter
steps."""
SMOOTHING_RAD = 1e-6
"""Angle whose rate, over the swing's, smooths the speed where it vanishes."""
MAX_REMAINING_AMPLITUDE = 0.95
"""Amplitude in the last fifth over that in the first. Basis: a choice; above it the swing hardly leaves the range of one
amplitude."""
PRESLIDING_GUESSES_RAD = (0.02, 0.1)


def _stokes_vectors(context: GuessContext, force_g: Array, frequency_hz: float, windows: int) -> tuple[Array, Array]:
    """Return the middles of windows of a few swings and their normalised Stokes vectors, shape (windows, 3)."""
    times_s, stokes = [], []
    for rows in np.array_split(np.arange(len(force_g)), windows):
        x, y = fit_sine_phasors(context.time_s[rows], force_g[rows, :2], frequency_hz)
        both = 2 * np.conj(x) * y
        times_s.append(float(context.time_s[rows].mean()))
        vector = np.array([abs(x) ** 2 - abs(y) ** 2, both.real, both.imag])
        stokes.append(vector / (abs(x) ** 2 + abs(y) ** 2))
    return np.array(times_s), np.array(stokes)


class PivotCompliance(Effect):
    """Quasi-static compliance of the jib, the girder or the clamp that carries the pivot."""

    name = "pivot_compliance"
    equation = "a_p = C n″; the load swings as at (L + C) n, with a spring that gives way by C n under its weight"
    explains = (
        "The jib, the girder or the clamp gives way under the swing, more in one direction than in another: the two periods "
        "differ and the ellipse changes its shape."
    )
    reference = "static deflection under the horizontal pull m g n; ω² = g/(L + c) along each principal direction of C"
    enters = "pivot"
    discriminating_experiment = SWING_BOTH_WAYS
    linear_at_neutral = False
    structure = ModelStructure.YIELDING_PIVOT
    world_directed = True
    parameters = (
        amplitude(
            "compliance_m",
            "m",
            "C, deflection of the pivot under a horizontal force of the load's weight",
            (0.0, 10.0),
            (0.15, 0.02),
            ("xx", "yy"),
        ),
        amplitude("coupling_m", "m", "C, deflection toward y under a force toward x", (-10.0, 10.0), 0.02),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return a compliance in one direction that turns the Stokes vector away from the model's as the recording does.

        Nothing if the shape changes as the model says, or otherwise than by two constant periods.
        """
        rate_1_s = small_swing_rate_1_s(context.length_m, context.gravity_m_s2)
        from_hz, to_hz = (share * rate_1_s / (2 * np.pi) for share in BAND)
        across = (context.force_g - context.force_g.mean(axis=0)) * [1.0, 1.0, 0.0] / context.noise_g
        line = find_strongest_line(context.time_s, across, from_hz, to_hz)
        windows = 0 if line is None else int(context.duration_s * line.frequency_hz / PERIODS_PER_WINDOW)
        if line is None or windows < MIN_WINDOWS:
            return []
        time_s, measured = _stokes_vectors(context, context.force_g, line.frequency_hz, windows)
        _, modelled = _stokes_vectors(context, context.force_g - context.residual_g, line.frequency_hz, windows)
        departure = measured - modelled
        departure -= departure.mean(axis=0)
        turned = [np.cross(axis, np.cumsum(modelled, axis=0)) * (time_s[1] - time_s[0]) for axis in np.eye(3)[:2]]
        design = np.stack([(each - each.mean(axis=0)).ravel() for each in turned], axis=1)
        rates, *_ = np.linalg.lstsq(design, departure.ravel(), rcond=None)
        unexplained = float(np.sum((departure.ravel() - design @ rates) ** 2) / max(np.sum(departure**2), TINY))
        difference_rad_s = float(np.hypot(*rates))
        if not (difference_rad_s * context.duration_s > MIN_TURN_RAD and unexplained < MAX_UNEXPLAINED):
            return []
        soft_m = 2 * context.length_m * difference_rad_s / rate_1_s  # ω² = g/(L + c)
        cos, sin = rates / difference_rad_s
        along_x_m, coupling_m, along_y_m = (float(soft_m * each / 2) for each in (1 + cos, sin, 1 - cos))
        return [{"compliance_m": (along_x_m, along_y_m), "coupling_m": coupling_m}]

    def pivot_compliance_m(self, p: Symbols) -> Vector:
        """Return the components of C."""
        xx, yy = p["compliance_m"]
        return xx, p["coupling_m"], yy


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
        amplitude(
            "hold_rad", "rad", "ε, largest angle from its rest at which the friction holds the load", (0.0, 0.2), 5e-4
        ),
        # The limit is that of a pin of 10 mm that yields by 0.4 mm.
        shape("presliding_rad", "rad", "δ, rotation of the contact before it slides", (1e-3, 0.1), 0.02, limit=0.019),
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
