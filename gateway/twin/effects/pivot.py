"""The structure that carries the pivot, as far as it yields."""

from devices.pendulum.equations import Vector
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.experiments import SWING_BOTH_WAYS
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.polarisation_guesses import guess_pivot_compliance


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
        Parameter(
            "compliance_m",
            "m",
            "C, deflection of the pivot under a horizontal force of the load's weight",
            lower=0.0,
            upper=10.0,
            neutral=0.0,
            scale=0.01,
            typical=(0.15, 0.02),
            components=("xx", "yy"),
        ),
        Parameter(
            "coupling_m",
            "m",
            "C, deflection toward y under a force toward x",
            lower=-10.0,
            upper=10.0,
            neutral=0.0,
            scale=0.01,
            typical=0.02,
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the compliance in one direction that changes the shape of the ellipse as the recording does."""
        return guess_pivot_compliance(context)

    def pivot_compliance_m(self, p: Symbols) -> Vector:
        """Return the components of C."""
        xx, yy = p["compliance_m"]
        return xx, p["coupling_m"], yy
