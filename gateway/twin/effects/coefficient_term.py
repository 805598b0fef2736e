"""Terms whose only parameters are coefficients, which are constant, changing or periodic."""

import math

from devices.pendulum.equations import Scalar
from gateway.twin.effects.coefficients import STEPS_PER_PERIOD, Coefficients
from gateway.twin.effects.parameter import Symbols, Values
from gateway.twin.effects.term import Term


class CoefficientTerm(Term):
    """Base class of terms whose parameters are coefficients; a subclass says which quantity they act on."""

    def __init__(
        self, name: str, formula: str, course: Coefficients, *, says: tuple[str, str], extends: str = ""
    ) -> None:
        self.name, self.formula, self.says, self.extends = name, formula, says, extends
        self.equation, self.explains = f"{self.quantity} = c {formula}", says[0]
        self.course = course
        self.parameters = course.parameters
        self.steady_frequency = course.is_periodic

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return a part of the period, where there is one."""
        return 1 / (STEPS_PER_PERIOD * p["frequency_hz"]) if self.course.is_periodic else math.inf

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the same term counted from a later first sample."""
        return self.course.shift_start(values, by_s)

    def law(self, values: Values) -> str:
        """Return the right-hand side with numbers and units."""
        return self.course.law(values, self.formula)
