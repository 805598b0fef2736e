"""Terms with a dead zone: a force that begins beyond it, and a reading with play, which follows late."""

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.term import HORIZONTAL, Term, coefficient, number, smoothed_length

SMOOTHING_G = 1e-6
"""Amplitude of a reading that counts as none. Basis: a choice; below the noise of a mean, above rounding."""
SMOOTHING_M = 1e-3
"""Displacement that counts as none. Basis: a choice; below a displacement that a reading shows, above rounding."""


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
        Parameter(
            "dead_zone_m",
            "m",
            "b, displacement up to which nothing acts",
            lower=1e-4,
            upper=100.0,
            neutral=0.5,
            scale=1e-2,
            typical=0.5,
            step_limit=0.1,
        ),
        coefficient("coefficient", "1/s²", "c", 0.02),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force."""
        x, y, _ = load.position_m
        factor = p["coefficient"] * ca.fmax(0.0, 1 - p["dead_zone_m"] / smoothed_length((x, y, 0.0), SMOOTHING_M))
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


DEAD_ZONE_TERMS: tuple[Term, ...] = (ForceWithDeadZone(), Backlash())
