"""What an effect is: a unit that says what it does to the model, in equations that are printed and in symbols that are run.

An effect overrides the hooks that it needs; the others leave the model as it is. Hooks get their parameters as symbols by
name, a tuple of symbols where the parameter has components.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.guess_context import GuessContext

Array = NDArray[np.float64]
Symbols = Mapping[str, Scalar]
Value = float | tuple[float, ...]
Values = Mapping[str, Value]
"""Parameters of one effect by name."""
NOTHING: Vector = (0.0, 0.0, 0.0)


class ModelStructure(Enum):
    """What hangs from the pivot; it fixes the state of the motion."""

    ROPE = "rope"
    RIGGING = "double pendulum"
    ELASTIC = "elastic rope"

    @property
    def n_states(self) -> int:
        """Length of the state x."""
        return {ModelStructure.ROPE: 9, ModelStructure.RIGGING: 15, ModelStructure.ELASTIC: 11}[self]

    @property
    def n_initial_states(self) -> int:
        """Length of the initial state z, the coordinates that are fitted."""
        return {ModelStructure.ROPE: 5, ModelStructure.RIGGING: 9, ModelStructure.ELASTIC: 7}[self]


class ParameterKind(Enum):
    """What a parameter means to a fit."""

    AMPLITUDE = "amplitude"
    """How strong the effect is."""
    START = "start"
    """When an event starts, in s since the recording's first sample."""
    DURATION = "duration"
    """How long an event, or a part of it, lasts, in s."""
    EDGE = "edge"
    """Share of an event in which it rises and falls."""
    FREQUENCY = "frequency"
    PHASE = "phase"
    CUTOFF = "cutoff"
    """A cutoff frequency: fitted by its inverse, the lag, to which samples respond in proportion."""


EVENT_TIME_KINDS = frozenset({ParameterKind.START, ParameterKind.DURATION, ParameterKind.EDGE})
"""Kinds without any sensitivity as long as the event's amplitude is zero."""


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
    kind: ParameterKind = ParameterKind.AMPLITUDE
    step_limit: float = math.inf
    """Largest change in one step of a fit: samples respond in proportion only that far."""
    prior_sigma: float | None = None
    """One sigma of what a drawing or a tape measure says, where the parameter is a belief about the rig."""
    operator_sigma: float | None = None
    """One sigma of what an operator brings about who tries for a value."""

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
    gravity_m_s2: float
    """Gravity at the rig's site."""
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
    discriminating_experiment: ClassVar[str] = "record for longer and from a wider swing"
    """Measurement or manoeuvre that separates this effect from others with the same signature."""

    transient: ClassVar[bool] = False
    """Acts for a time; parameters of kind START and DURATION say when."""
    linear_at_neutral: ClassVar[bool] = True
    """The sensitivity at the neutral values shows whether the effect is there."""
    scored: ClassVar[bool | None] = None
    """A score test at the neutral values ranks it; None means as `linear_at_neutral` and only if it is not transient."""
    found_before_search: ClassVar[bool] = False
    """Detected in the samples, the spectrum or the time stamps; the search does not try it."""
    detected_in_samples: ClassVar[bool] = False
    """Visible in the values of the samples themselves; backward elimination does not remove it."""
    structure: ClassVar[ModelStructure] = ModelStructure.ROPE
    """Structure that the effect gives to the model; two effects with different ones exclude each other."""
    world_directed: ClassVar[bool] = False
    """Has a direction in the world, so that the housing's heading matters."""
    changes_length: ClassVar[bool] = False
    """An event after which the rope has another length."""
    instantaneous: ClassVar[bool] = False
    """An event without duration."""
    profile_modelled: ClassVar[bool] = True
    """False where the exact course of an event is not modelled: its samples count neither for nor against a model."""
    scales_period: ClassVar[bool] = False
    """Changes the rate of the whole motion, as a clock that runs slow does."""
    length_like: ClassVar[bool] = False
    """Makes up for a wrong distance along the rope: a nuisance after an event that changed it."""
    mixes_axes: ClassVar[bool] = False
    """Reads a constant linear combination of the three axes; several such effects are one matrix."""
    needs_temperature: ClassVar[bool] = False
    """Shows only in recordings with a temperature."""
    steady_frequency: ClassVar[bool] = False
    """Has a parameter `frequency_hz`; residual lines close to it contradict the effect."""
    slow_convergence: ClassVar[bool] = False
    """Its parameters lie in a narrow valley of chi-square: a fit needs more iterations to converge."""
    segment_s: ClassVar[float] = math.inf
    """Longest segment of multiple shooting that a fit from rest can follow."""
    needs_single_segment: ClassVar[bool] = False
    """Has memory that segments of multiple shooting do not carry over."""
    min_duration_s: ClassVar[float] = 0.0
    """Shortest duration for which the search accepts the effect."""
    default_guess: ClassVar[Values] = MappingProxyType({})
    """Where a fit starts; parameters left out start at their neutral values."""

    @property
    def is_scored(self) -> bool:
        """Whether a score test ranks the effect."""
        return not self.transient and (self.linear_at_neutral if self.scored is None else self.scored)

    @property
    def is_guessed_from_residual(self) -> bool:
        """Whether a persistent effect is searched for from initial guesses that come from the residual."""
        return not (self.transient or self.is_scored or self.found_before_search)

    @property
    def guesses_from_data(self) -> bool:
        """Whether the effect has initial guesses of its own."""
        return type(self).initial_guesses is not Effect.initial_guesses

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """Starting points of a fit, the most likely first; none where the data show no sign of the effect."""
        return [self.default_guess]

    def interval_s(self, values: Values) -> tuple[float, float] | None:
        """When a transient effect acts, in s since the recording's first sample; None for a persistent one."""
        if not self.transient:
            return None
        start_s = sum(self.numbers(values, ParameterKind.START))
        return start_s, start_s + sum(self.numbers(values, ParameterKind.DURATION))

    def numbers(self, values: Values, kind: ParameterKind) -> list[float]:
        """Values of the scalar parameters of a kind, in their order; parameters that are not given are left out."""
        return [float(np.asarray(values[p.name])) for p in self.parameters if p.kind is kind and p.name in values]

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """What the integration needs to follow this effect on a rope of a believed length under the rig's gravity."""
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

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Samples (n, 3) in g as the sensor hands them on, noise included; for simulated recordings."""
        return force_g

    def keep_samples(self, values: Values, count: int, random: np.random.Generator) -> NDArray[np.bool_] | None:
        """Which of `count` samples arrive, shape (count,); None for all. For simulated recordings."""
        return None

    @property
    def acts_on_noisy_samples(self) -> bool:
        """Whether a simulated recording has the effect applied to its noisy samples instead of to the prediction."""
        return (
            type(self).sample_output_g is not Effect.sample_output_g
            or type(self).keep_samples is not Effect.keep_samples
        )

    def true_time_s(self, p: Symbols, elapsed_s: Scalar) -> Scalar:
        """True time since the recording's first sample by the recorded one."""
        return elapsed_s


def parameter_label(parameter: Parameter, component: int) -> str:
    """`accel_m_s2[x]`, or the name alone where it has no components."""
    return f"{parameter.name}[{parameter.components[component]}]" if parameter.components else parameter.name
