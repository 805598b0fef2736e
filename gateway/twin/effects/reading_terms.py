"""Terms of the reading: offsets that change with time, and readings that are no straight line."""

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.force_terms import shifted_level
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.term import AXES, HORIZONTAL, Term, coefficient, number

SMOOTHING_G = 1e-6
"""Amplitude of a reading that counts as none."""


class ReadingTerm(Term):
    """Base class of what is added to the reading."""

    enters = "sensor"
    quantity = "reading"


class ChangingOffset(ReadingTerm):
    """An offset that changes evenly with time."""

    name = "changing_offset"
    equation = "f_i + b_i + b′_i t"
    formula = "t"
    says = ("the sensor's zero moves evenly with time",) * 2
    explains = says[0]
    parameters = (
        coefficient("slope", "g/s", "b′ of each axis", 5e-5, AXES),
        coefficient("level", "g", "b of each axis at the first sample", 2e-3, AXES),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add level and slope to each axis."""
        parts = zip(reading, p["level"], p["slope"], strict=True)
        x, y, z = (f + level + slope * context.time_s for f, level, slope in parts)
        return x, y, z

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the same offset counted from a later first sample."""
        return shifted_level(values, by_s)

    def law(self, values: Values) -> str:
        """Return level and slope of each axis."""
        return f"{number(values['level'])} g {number(values['slope'])} g/s t"


class CreepingOffset(ReadingTerm):
    """An offset that settles after the start."""

    name = "creeping_offset"
    equation = "f_i + b_i exp(−t/τ)"
    formula = "exp(−t/τ)"
    says = ("the sensor's zero settles after the start",) * 2
    explains = says[0]
    parameters = (
        Parameter(
            "time_constant_s",
            "s",
            "τ",
            lower=2.0,  # what is over within part of a swing is no offset that settles
            upper=1e4,
            neutral=10.0,
            scale=0.1,
            typical=10.0,
            step_limit=20.0,
        ),
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


class Backlash(ReadingTerm):
    """A reading with play: after each turning point it stays until the motion has crossed the play.

    The play of a sine of amplitude A, in closed form: coming down from A, the follower is behind by min(A - f, 2 b) - b.
    """

    name = "backlash"
    equation = "f_i + c_i e(f_i), e in (−b, b) behind the motion, i across the rope"
    formula = "e(f)"
    says = ("play: the reading turns back later than the load",) * 2
    explains = says[0]
    needs_quadrature = True
    hides_small_motion = True
    parameters = (
        Parameter(
            "gap_g",
            "g",
            "b, half of the play",
            lower=1e-5,
            upper=1.0,
            neutral=2e-3,
            scale=1e-4,
            typical=2e-3,
            step_limit=5e-3,
        ),
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


READING_TERMS: tuple[Term, ...] = (ChangingOffset(), CreepingOffset(), QuadraticReading(), Backlash())
