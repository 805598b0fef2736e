"""What an effect is: a unit that says what it does to the model, in equations that are printed and in symbols that are run.

An effect overrides the hooks that it needs; the others leave the model as it is. Hooks get their parameters as symbols by
name, a tuple of symbols where the parameter has components.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from devices.pendulum.equations import Scalar, Vector

Symbols = Mapping[str, Scalar]
Value = float | tuple[float, ...]
NOTHING: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number, or a few of the same kind, that an effect has."""

    name: str
    unit: str
    meaning: str
    lower: float
    upper: float
    """Bounds of each component; a bound of 0 is a constraint on the sign."""
    neutral: float
    """Where the effect vanishes, or, for a parameter that does not make it vanish, where to start looking."""
    scale: float
    """A change of this size is one that an operator would call small."""
    typical: Value
    """What `simulate` takes when nothing else is said."""
    components: tuple[str, ...] = ()
    """Names of the components of a parameter that has several."""
    refitted: bool = False
    """Belongs to a recording, not to the rig: the phase of a periodic effect."""

    @property
    def size(self) -> int:
        """Number of components."""
        return max(1, len(self.components))


@dataclass(frozen=True, slots=True)
class EvaluationContext:
    """An instant inside an integration step. Steps end at the edges of events, so a step is wholly inside or outside."""

    time_s: Scalar
    middle_s: Scalar
    """The middle of the step: it decides whether an event acts, so that no rounding at an edge can."""
    warmer_c: Scalar = 0.0
    """By how much the sensor is warmer than where its offsets are known."""
    stretch: tuple[Scalar, Scalar, Scalar] = NOTHING
    """Of an elastic rope beyond that of a load at rest, with its two derivatives."""

    def is_between(self, start_s: Scalar, end_s: Scalar) -> Scalar:
        """1 between two edges, 0 outside."""
        return (self.middle_s >= start_s) * (self.middle_s < end_s)

    def step_at(self, start_s: Scalar) -> Scalar:
        """1 from an edge on, 0 before."""
        return self.middle_s >= start_s


@dataclass(frozen=True, slots=True)
class RopeGeometry:
    """Lengths at an instant with their first two derivatives, in m, m/s, m/s^2."""

    length: tuple[Scalar, Scalar, Scalar]
    """Pivot to the load's centre; with a double pendulum pivot to the hook."""
    position: tuple[Scalar, Scalar, Scalar]
    """Pivot to the accelerometer."""


@dataclass(frozen=True, slots=True)
class BodyState:
    """The load, or the housing, at an instant, in the world."""

    place: Vector
    """Relative to the pivot, in m."""
    velocity: Vector
    """Relative to the pivot, in m/s."""
    swing_rate: Scalar
    """sqrt(g/L) of the believed rope, in 1/s."""


class Effect:
    """Base of all effects."""

    name: ClassVar[str]
    equation: ClassVar[str]
    """As printed in a report."""
    explains: ClassVar[str]
    """What it would mean, in an operator's words."""
    reference: ClassVar[str]
    enters: ClassVar[str]
    """force on the load, pivot, rope, structure, housing, sensor or clock."""
    parameters: ClassVar[tuple[Parameter, ...]]
    transient: ClassVar[bool] = False
    """It acts for a time; its parameters say when."""
    linear_at_neutral: ClassVar[bool] = True
    """The sensitivity at the neutral values tells whether the effect is there."""

    def longest_step_s(self, p: Symbols, length_m: float) -> Scalar:
        """What the integration needs to follow this effect on a rope of a believed length."""
        return math.inf

    def upper_bound(self, parameter: Parameter, length_m: float) -> float:
        """Of a parameter, on a rope of a believed length."""
        return parameter.upper

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Times at which what acts has a jump."""
        return ()

    def velocity_jump_m_s(self, p: Symbols) -> Vector | None:
        """A jump of the load's velocity in m/s at the first of the edges."""
        return None

    def ropes(self, p: Symbols, now: EvaluationContext, ropes: RopeGeometry) -> RopeGeometry:
        """Lengths with this effect."""
        return ropes

    def stretch_m_s2(self, p: Symbols, now: EvaluationContext, beyond_rest_m_s2: Scalar) -> Scalar:
        """Second derivative of the stretch; given is what pulls the load along the rope beyond its weight at rest."""
        return 0.0

    def force_m_s2(self, p: Symbols, now: EvaluationContext, load: BodyState) -> Vector:
        """Force on the load over its mass."""
        return NOTHING

    def pivot_m_s2(self, p: Symbols, now: EvaluationContext) -> Vector:
        """Acceleration of the pivot."""
        return NOTHING

    def fictitious_acceleration_m_s2(self, p: Symbols, now: EvaluationContext, housing: BodyState) -> Vector:
        """What the housing feels beyond its acceleration against the pivot's frame, where that frame turns."""
        return NOTHING

    def housing_rotation_rad(self, p: Symbols, now: EvaluationContext) -> Scalar:
        """By how much the housing has turned about the rope, right-handed about its z axis."""
        return 0.0

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """What the sensor makes of what it feels, before its low-pass."""
        return reading

    def output_stage_g(self, p: Symbols, reading: Vector) -> Vector:
        """What it hands on of a filtered reading."""
        return reading

    def true_time_s(self, p: Symbols, elapsed_s: Scalar) -> Scalar:
        """True time since the recording's first sample by the recorded one."""
        return elapsed_s


def parameter_label(parameter: Parameter, component: int) -> str:
    """`accel_m_s2[x]`, or the name alone where it has no components."""
    return f"{parameter.name}[{parameter.components[component]}]" if parameter.components else parameter.name
