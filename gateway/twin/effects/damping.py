"""What takes energy out of the swing."""

import casadi as ca

from devices.pendulum.equations import Vector, dot, scale
from gateway.twin.effects.effect import BodyState, Effect, EvaluationContext, Parameter, Symbols

LARGER_SWING = "record from a swing twice as wide until it has died away to a quarter"
SLOWEST_M_S = 1e-3
"""Coulomb friction turns over within this speed; without it the force would jump at every turning point."""


class ViscousDamping(Effect):
    """A' = -zeta w0 A."""

    name = "viscous_damping"
    equation = "F/m = −2 ζ √(g/L) v"
    explains = "The swing dies away by the same part in each period: losses in rope, sheaves and joints."
    reference = "physics of the linear oscillator; envelope A' = −c A/2, c = 2 ζ w0"
    enters = "force on the load"
    discriminating_experiment = LARGER_SWING
    parameters = (Parameter("damping_ratio", "1", "part of critical damping", 0.0, 0.5, 0.0, 1e-3, 5e-3),)

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """Against the velocity, in proportion to it."""
        return scale(-2 * p["damping_ratio"] * load.swing_rate, load.velocity)


class QuadraticDrag(Effect):
    """A' = -(4/3 pi) k L w A^2."""

    name = "quadratic_drag"
    equation = "F/m = −k |v| v"
    explains = "Large swings die away faster than small ones: drag of the air on a large, light load."
    reference = "drag law k = ρ_air c_d A / (2 m); envelope A' = −(4/3π) k L w A²"
    enters = "force on the load"
    discriminating_experiment = LARGER_SWING
    parameters = (Parameter("drag_per_m", "1/m", "k", 0.0, 1.0, 0.0, 1e-3, 5e-3),)

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """Against the velocity, as its square."""
        speed = ca.sqrt(dot(load.velocity, load.velocity) + SLOWEST_M_S**2)
        return scale(-p["drag_per_m"] * speed, load.velocity)


class CoulombFriction(Effect):
    """A' = -2 mu/(pi w)."""

    name = "coulomb_friction"
    equation = "F/m = −μ v/|v|"
    explains = "Small swings die away faster than large ones and come to a stop: dry friction at the pivot."
    reference = "Coulomb's law; envelope A' = −2 μ/(π w L)"
    enters = "force on the load"
    discriminating_experiment = LARGER_SWING
    parameters = (Parameter("decel_m_s2", "m/s²", "μ", 0.0, 0.5, 0.0, 1e-3, 4e-3),)

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """Against the velocity, whatever its size."""
        speed = ca.sqrt(dot(load.velocity, load.velocity) + SLOWEST_M_S**2)
        return scale(-p["decel_m_s2"] / speed, load.velocity)
