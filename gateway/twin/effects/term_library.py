"""Terms of the reading, and dead zones; the library of all terms, and their time in the registry of effects."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext
from gateway.twin.effects.force_terms import FORCE_TERMS, KINEMATIC_TERMS
from gateway.twin.effects.parameter import Symbols, Values, shape
from gateway.twin.effects.term import AXES, HORIZONTAL, CoefficientTerm, Term, coefficient, number, periodic

SMOOTHING_G = 1e-6
"""Amplitude of a reading that counts as none. Basis: a choice; below the noise of a mean, above rounding."""
SMOOTHING_M = 1e-3
"""Displacement that counts as none. Basis: a choice; below a displacement that a reading shows, above rounding."""


class OffsetTerm(CoefficientTerm):
    """An offset of each axis."""

    enters = "sensor"
    quantity = "reading"

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the offset."""
        x, y, z = (f + each for f, each in zip(reading, self.course.at(p, context), strict=True))
        return x, y, z


class ReadingTerm(Term):
    """Base class of what depends on the reading, or settles."""

    enters = "sensor"
    quantity = "reading"


class CreepingOffset(ReadingTerm):
    """An offset that settles after the start."""

    name = "creeping_offset"
    equation = "f_i + b_i exp(−t/τ)"
    formula = "exp(−t/τ)"
    says = ("the sensor's zero settles after the start",) * 2
    explains = says[0]
    parameters = (
        # What is over within two seconds, part of a swing, is no offset that settles.
        shape("time_constant_s", "s", "τ", (2.0, 1e4), 10.0, step_limit=20.0),
        coefficient("offset_g", "g", "b of each axis at the first sample", 5e-3, AXES),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add an offset that decays."""
        left = ca.exp(-context.time_s / p["time_constant_s"])
        x, y, z = (f + b * left for f, b in zip(reading, p["offset_g"], strict=True))
        return x, y, z

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return what is left of the offset at a later first sample."""
        left = float(np.exp(-by_s / float(np.asarray(values["time_constant_s"]))))
        return {**values, "offset_g": tuple((left * np.asarray(values["offset_g"])).tolist())}

    def law(self, values: Values) -> str:
        """Return offset and time constant."""
        tau_s = float(np.asarray(values["time_constant_s"]))
        return f"{number(values['offset_g'])} g {self.formula}, τ = {tau_s:.3g} s"


class QuadraticReading(ReadingTerm):
    """A sensitivity that bends."""

    name = "quadratic_reading"
    equation = "f_i + k_i (f_i − f_i0)², f_0 the reading at rest"
    formula = "(f − f_0)²"
    says = ("the sensitivity changes with what is read",) * 2
    explains = says[0]
    parameters = (coefficient("per_g", "1/g", "k of each axis", 0.5, AXES),)

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the square of the change."""
        parts = zip(reading, (0.0, 0.0, 1.0), p["per_g"], strict=True)
        x, y, z = (f + k * (f - rest) ** 2 for f, rest, k in parts)
        return x, y, z


class DelayedReading(ReadingTerm):
    """A reading whose axes across the rope are sampled later than the axial one, to first order in the delay.

    A delay of all three axes is another start of the same motion, and shows nowhere.
    """

    name = "delayed_reading"
    equation = "f_i(t − τ_i) ≈ f_i − τ_i f′_i, i across the rope"
    formula = "−f′"
    says = (
        "the axes across the rope are read later than the axial one",
        "the axes across the rope are read earlier than the axial one",
    )
    explains = says[0]
    needs_quadrature = True
    parameters = (coefficient("delay_s", "s", "τ, behind the axial axis", 0.02, HORIZONTAL),)

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Subtract what the reading changes during the delay."""
        x, y, z = reading
        (x_rate, y_rate, _), (x_delay_s, y_delay_s) = context.quadrature_g, p["delay_s"]
        rate_1_s = context.small_swing_rate_1_s
        return x - x_delay_s * rate_1_s * x_rate, y - y_delay_s * rate_1_s * y_rate, z


class ForceWithDeadZone(Term):
    """A force by the displacement with a dead zone: nothing acts near the middle."""

    name = "force_with_dead_zone"
    enters = "force on the load"
    quantity = "force/mass"
    equation = "F/m = c (1 − b/r) (x, y) where r = |(x, y)| > b"
    formula = "(1 − b/r) (x, y), r > b"
    says = ("pushed outwards beyond a dead zone", "held back beyond a dead zone, as by a guide with play")
    explains = says[1]
    parameters = (
        shape("dead_zone_m", "m", "b, displacement up to which nothing acts", (1e-4, 100.0), 0.5, step_limit=0.1),
        coefficient("coefficient", "1/s²", "c", 0.02),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force."""
        x, y, _ = load.position_m
        factor = p["coefficient"] * ca.fmax(0.0, 1 - p["dead_zone_m"] / ca.sqrt(x**2 + y**2 + SMOOTHING_M**2))
        return factor * x, factor * y, 0.0

    def law(self, values: Values) -> str:
        """Return coefficient and dead zone."""
        return f"{super().law(values)}, b = {float(np.asarray(values['dead_zone_m'])):.3g} m"


class Backlash(Term):
    """A reading with play: after each turning point it stays until the motion has crossed the play.

    The play of a sine of amplitude A, in closed form: coming down from A, the follower is behind by min(A - f, 2 b) - b.
    """

    name = "backlash"
    enters = "sensor"
    quantity = "reading"
    equation = "f_i + c_i e(f_i), e in (−b, b) behind the motion, i across the rope"
    formula = "e(f)"
    says = ("play: the reading turns back later than the load",) * 2
    explains = says[0]
    needs_quadrature = True
    hides_small_motion = True
    parameters = (
        shape("gap_g", "g", "b, half of the play", (1e-5, 1.0), 2e-3, step_limit=5e-3),
        coefficient("share", "1", "c, share of the reading that has play", 0.5, HORIZONTAL),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add what the play lags behind to the axes across the rope."""
        x, y, z = reading
        (x_rate, y_rate, _), (x_share, y_share) = context.quadrature_g, p["share"]
        return x + x_share * _lag_g(x, x_rate, p["gap_g"]), y + y_share * _lag_g(y, y_rate, p["gap_g"]), z

    def law(self, values: Values) -> str:
        """Return share and gap."""
        return f"{number(values['share'])} {self.formula}, b = {float(np.asarray(values['gap_g'])):.3g} g"


def _lag_g(reading: Scalar, quadrature: Scalar, gap: Scalar) -> Scalar:
    amplitude = ca.sqrt(reading**2 + quadrature**2 + SMOOTHING_G**2)
    falling = ca.fmin(amplitude - reading, 2 * gap) - gap
    rising = gap - ca.fmin(amplitude + reading, 2 * gap)
    return ca.if_else(quadrature < 0, falling, rising)


READING_TERMS: tuple[Term, ...] = (
    OffsetTerm(
        "periodic_offset",
        "sin(2π f t + φ)",
        periodic("g", 0.002, AXES),
        says=("the reading itself goes up and down at one frequency",) * 2,
    ),
    CreepingOffset(),
    QuadraticReading(),
    DelayedReading(),
    ForceWithDeadZone(),
    Backlash(),
)


TERMS: Mapping[str, Term] = {term.name: term for term in (*FORCE_TERMS, *KINEMATIC_TERMS, *READING_TERMS)}
"""Every term by its name."""
OF_MODELS, OF_SEARCH = "the terms of a model", "the library of terms"
"""Sources in the registry of effects."""


def register_terms(names: Iterable[str]) -> None:
    """Add those terms that a model names to the registry, to stay; other names are left alone."""
    EFFECTS.register([TERMS[name] for name in names if name in TERMS and name not in EFFECTS], OF_MODELS)


@contextmanager
def registered_library() -> Iterator[None]:
    """Add all terms to the registry of effects for as long as a law is sought."""
    EFFECTS.register([term for name, term in TERMS.items() if name not in EFFECTS], OF_SEARCH)
    try:
        yield
    finally:
        EFFECTS.unregister(OF_SEARCH)
