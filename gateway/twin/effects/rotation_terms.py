"""Terms of the housing's rotation about the rope, without a steady period."""

from devices.pendulum.equations import Scalar
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.parameter import Symbols
from gateway.twin.effects.term import Term, coefficient


class SteadyRotation(Term):
    """A housing that turns evenly about the rope; its angle at the first sample is the heading."""

    name = "steady_rotation"
    enters = "housing"
    quantity = "rotation about the rope"
    equation = "ψ = c t"
    formula = "t"
    says = ("the housing turns anticlockwise about the rope", "the housing turns clockwise about the rope")
    explains = says[0]
    parameters = (coefficient("coefficient", "rad/s", "c", 0.01),)

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle."""
        return p["coefficient"] * context.time_s


ROTATION_TERMS: tuple[Term, ...] = (SteadyRotation(),)
