"""Forces that take energy out of the swing."""

from devices.pendulum.equations import Vector, scale
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext
from gateway.twin.effects.experiments import LARGER_SWING
from gateway.twin.effects.parameter import Parameter, Symbols


class ViscousDamping(Effect):
    """Force proportional to the velocity; the amplitude decays as A' = -c A/2, c = 2 zeta sqrt(g/L)."""

    name = "viscous_damping"
    equation = "F/m = −2 ζ √(g/L) v"
    explains = "The swing loses the same fraction in each period: losses in the rope, the sheaves and the joints."
    reference = "viscous damping, Inman 2014, section 1.3: A′ = −c A/2, c = 2 ζ √(g/L)"
    enters = "force on the load"
    dissipative = True
    discriminating_experiment = LARGER_SWING
    parameters = (
        Parameter(
            "damping_ratio",
            "1",
            "ζ, fraction of critical damping",
            lower=0.0,
            upper=0.5,
            neutral=0.0,
            scale=1e-3,
            typical=5e-3,
        ),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return a force against the velocity."""
        return scale(-2 * p["damping_ratio"] * load.small_swing_rate_1_s, load.velocity_m_s)


class QuadraticDrag(Effect):
    """Force proportional to the square of the speed; the amplitude decays as A' = -(4/3 pi) k L w A^2."""

    name = "quadratic_drag"
    equation = "F/m = −k |v| v"
    explains = "Large swings die away faster than small ones: air drag on a large, light load."
    reference = "drag law, k = ρ_air c_d A/(2 m); by the work in one period: A′ = −(4/3π) k L ω A²"
    enters = "force on the load"
    dissipative = True
    discriminating_experiment = LARGER_SWING
    parameters = (
        Parameter(
            "drag_per_m",
            "1/m",
            "k, drag coefficient over mass",
            lower=0.0,
            upper=1.0,
            neutral=0.0,
            scale=1e-3,
            typical=5e-3,
        ),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return a force against the velocity."""
        return scale(-p["drag_per_m"] * load.speed_m_s, load.velocity_m_s)


class CoulombFriction(Effect):
    """Force of constant magnitude against the velocity; the amplitude decays as A' = -2 mu/(pi w L)."""

    name = "coulomb_friction"
    equation = "F/m = −μ v/|v|"
    explains = "Small swings die away faster than large ones and come to a stop: dry friction at the pivot."
    reference = "Coulomb friction, Inman 2014, section 1.10: A′ = −2 μ/(π ω L)"
    enters = "force on the load"
    dissipative = True
    discriminating_experiment = LARGER_SWING
    parameters = (
        Parameter(
            "decel_m_s2",
            "m/s²",
            "μ, friction force over mass",
            lower=0.0,
            upper=0.5,
            neutral=0.0,
            scale=1e-3,
            typical=4e-3,
        ),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return a force against the velocity, of a magnitude that does not depend on it."""
        return scale(-p["decel_m_s2"], load.direction_of_motion(p["decel_m_s2"]))
