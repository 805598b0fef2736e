"""The quantities that the equations of effects are evaluated with: time, gravity, rope lengths, motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import casadi as ca

from devices.pendulum.equations import Scalar, Vector, WithDerivatives, dot, scale

ZERO_VECTOR: Vector = (0.0, 0.0, 0.0)
REVERSAL_RAD = 0.05
"""Phase of the swing before and after a turning point within which the direction of motion reverses. The integration then sees
the reversal at any amplitude; friction takes 0.07 % less energy from the swing than with an instant reversal."""
LEAST_SPEED_M_S = 1e-3
"""Speed within which the direction of motion of a load below the pivot reverses."""
HOLDING_SHARE = 0.1
"""The same over the largest speed of a swing that friction would hold: the end of a motion must take longer than a step of the
integration, 0.12 rad."""


@dataclass(frozen=True, slots=True)
class EvaluationContext:
    """An instant inside an integration step.

    Steps end at the discontinuities of events, so a step lies wholly inside or outside an event.
    """

    time_s: Scalar
    step_middle_s: Scalar
    """Middle of the step: it decides whether an event acts, so that rounding at a discontinuity cannot."""
    gravity_m_s2: Scalar
    temperature_rise_c: Scalar = 0.0
    """Temperature of the sensor above the one at which its offsets are known."""
    stretch: WithDerivatives = ZERO_VECTOR
    """Stretch of an elastic rope beyond that under a load at rest, in m, m/s, m/s²."""
    quadrature_g: Vector = ZERO_VECTOR
    """Derivative of the reading by time over √(g/L), for effects that need it: in a steady swing a quarter period ahead."""
    small_swing_rate_1_s: Scalar = 1.0
    """√(g/L) of the rope as the model has it at first: errors of its stated length, and the load's inertia, included."""

    def is_between(self, start_s: Scalar, end_s: Scalar) -> Scalar:
        """Return 1 between two discontinuities, else 0."""
        return (self.step_middle_s >= start_s) * (self.step_middle_s < end_s)

    def step_at(self, start_s: Scalar) -> Scalar:
        """Return 1 from a discontinuity on, 0 before."""
        return self.step_middle_s >= start_s


@dataclass(frozen=True, slots=True)
class RopeGeometry:
    """Distances from the pivot along the rope, in m, m/s, m/s²."""

    length: WithDerivatives
    """From the pivot to the centre of the load; with a double pendulum to the hook."""
    position: WithDerivatives
    """From the pivot to the accelerometer."""
    gyration_squared_m2: Scalar = 0.0
    """Square of the load's radius of gyration about a horizontal axis through its centre; 0 for a point load."""
    is_placed_from_load: bool = False
    """Whether the accelerometer's place was measured from the load: a rope of another length than stated moves it along."""

    @property
    def oscillation_length(self) -> WithDerivatives:
        """Distance to the load's centre of oscillation, L + k²/L, with the derivatives of L.

        The angular momentum (L² + k²) n′ gives n″ = (I − n nᵀ) d/(L + k²/L) − 2 L′ n′/(L + k²/L) − |n′|² n.
        """
        length, rate, acceleration = self.length
        return length + self.gyration_squared_m2 / length, rate, acceleration

    def with_changes(self, of_length: Sequence[Scalar], of_position: Sequence[Scalar]) -> "RopeGeometry":
        """Return it with changes of both distances, each followed by its derivatives where it has any; empty: no change."""
        return replace(self, length=_sum(self.length, of_length), position=_sum(self.position, of_position))


def _sum(parts: WithDerivatives, changes: Sequence[Scalar]) -> WithDerivatives:
    value, rate, acceleration = (part + change for part, change in zip_longest(parts, changes, fillvalue=0.0))
    return value, rate, acceleration


@dataclass(frozen=True, slots=True)
class Rigging:
    """Rigging below a hook block with mass."""

    length_m: Scalar
    """From the hook to the centre of the load."""
    hook_mass_ratio: Scalar
    """Mass of the hook block divided by the mass of the load."""

    def with_load_inertia(self, gyration_squared_m2: Scalar) -> "Rigging":
        """Return the rigging with two point loads, at hook and centre of oscillation, that move as a load with inertia does.

        Equimomental system: both have the load's mass, centre and moment of inertia (Routh 1905, section 32).
        """
        beyond_m = gyration_squared_m2 / self.length_m
        to_oscillation_m = self.length_m + beyond_m
        at_hook, below = beyond_m / to_oscillation_m, self.length_m / to_oscillation_m
        return Rigging(to_oscillation_m, (self.hook_mass_ratio + at_hook) / below)


@dataclass(frozen=True, slots=True)
class BodyState:
    """Position and velocity of the load, or of the housing, in the frame of the world."""

    position_m: Vector
    """Relative to the pivot."""
    velocity_m_s: Vector
    """Relative to the pivot."""
    small_swing_rate_1_s: Scalar
    """√(g/L) of the rope as the model has it at first: errors of its stated length, and the load's inertia, included."""
    presliding_rad: Vector = ZERO_VECTOR
    """Elastic rotation of the pivot's contact before it slides, a rotation vector; for friction that holds."""

    @property
    def speed_m_s(self) -> Scalar:
        """The magnitude of the velocity, with a derivative at rest."""
        return ca.sqrt(dot(self.velocity_m_s, self.velocity_m_s) + LEAST_SPEED_M_S**2)

    def direction_of_motion(self, friction_m_s2: Scalar = 0.0) -> Vector:
        """Return the velocity over the speed; it passes through zero at a turning point, and where friction holds."""
        x, y, _ = self.position_m
        turning_m2_s2 = (REVERSAL_RAD * self.small_swing_rate_1_s) ** 2 * (x * x + y * y)
        holding_m_s = HOLDING_SHARE * friction_m_s2 / self.small_swing_rate_1_s
        least_m2_s2 = turning_m2_s2 + holding_m_s**2 + LEAST_SPEED_M_S**2
        squared_m2_s2 = dot(self.velocity_m_s, self.velocity_m_s)
        smoothed_m_s = ca.sqrt(ca.sqrt(squared_m2_s2 * squared_m2_s2 + least_m2_s2 * least_m2_s2))
        return scale(1 / smoothed_m_s, self.velocity_m_s)
