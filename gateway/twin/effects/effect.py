"""The base class of effects: an effect describes one physical cause by equations, parameters, traits and initial guesses.

An effect overrides the hooks that it needs; the others leave the model unchanged. A hook receives the parameters by name as
symbols of CasADi (a tuple of symbols for a parameter with components), and returns expressions of them.
"""

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from devices.pendulum.heavy_rope import HeavyRope
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, BodyState, EvaluationContext, Rigging, RopeGeometry
from gateway.twin.effects.guess_context import GuessContext, guess_event
from gateway.twin.effects.parameter import Parameter, ParameterKind, Symbols, Values

MEASURE_ROPE = "measure the rope, or compare the recording's clock with another over some minutes"
MEASURE_TO_CENTRE = (
    "measure the length to the load's centre; or swing with another length: an error of the length keeps its share of the "
    "length, the load's inertia loses weight as the rope grows"
)
WEIGH_LOAD = (
    "measure the rope and weigh rope and load; or swing with a heavier load on the same rope, which leaves an error of the "
    "length as it is"
)
MEASURE_HOUSING = (
    "turn the sensor upside down at rest: an offset keeps its sign, a scale error does not; measure the housing's place"
)
TURN_HOUSING = (
    "turn the housing about the rope by 90 degrees and record again: what stays with the sensor is offset, mount or "
    "cross-axis sensitivity, what turns is wind; a wider swing separates a tilt from an offset"
)
RECORD_DRIVES = "repeat the manoeuvre with the drives' own signals recorded, or with a second sensor at the pivot"
LOCK_SLEWING = "repeat with the crane's slewing locked; or look at the housing while the load swings"
SWING_BOTH_WAYS = (
    "swing along the jib or girder, then across it, and compare the periods; or record a second sensor at the pivot"
)
SWING_TO_REST = "let the swing die away until it stops, and compare the periods of large and of small swings"
LARGER_SWING = "record from a swing twice as wide until it has died away to a quarter"
MEASURE_LEVER_ARM = (
    "measure how far beside the rope's line the sensor sits; or turn the housing on its clamp by 180 degrees and record again: "
    "a lever arm changes sides with the housing, a tilt of the sensor in the housing does not"
)
MEASURE_CLAMP = (
    "push the housing across the rope by hand at rest and see whether it turns; tighten its clamp and record again"
)


Array = NDArray[np.float64]


class ModelStructure(Enum):
    """The bodies that hang from the pivot; they determine the state of the model."""

    ROPE = "rope"
    RIGGING = "double pendulum"
    ELASTIC = "elastic rope"
    YIELDING_PIVOT = "yielding pivot"
    PRESLIDING = "friction that holds"
    HEAVY_ROPE = "heavy rope"


class Effect:
    """Base class of all effects."""

    name: str
    equation: str
    """The equation as the report prints it."""
    explains: str
    """The physical cause in an operator's words."""
    reference: ClassVar[str]
    """The source of the equation: authors, year and equation, a standard, or the physical law."""
    enters: ClassVar[str]
    """The part of the model that the effect changes: force on the load, pivot, rope, structure, housing, sensor or clock."""
    parameters: tuple[Parameter, ...]
    discriminating_experiment: ClassVar[str] = "record for longer and from a wider swing"
    """The measurement or manoeuvre that separates the effect from others with the same signature."""

    transient: ClassVar[bool] = False
    """The effect is an event: it acts for a limited time, given by its parameters of the kinds START and DURATION."""
    linear_at_neutral: ClassVar[bool] = True
    """The sensitivity at the neutral values reveals the effect."""
    scored: ClassVar[bool | None] = None
    """Whether a score test at the neutral values ranks the effect; None for the default, see `is_scored`."""
    found_before_search: ClassVar[bool] = False
    """The effect is detected in the samples, the spectrum or the time stamps; the search does not try it."""
    detected_in_samples: ClassVar[bool] = False
    """The values of the samples themselves show the effect; backward elimination keeps it."""
    structure: ClassVar[ModelStructure] = ModelStructure.ROPE
    """The structure that the effect gives to the model; effects with different structures exclude each other."""
    dissipative: ClassVar[bool] = False
    """The effect takes energy out of the swing. No real swing is without such an effect."""
    in_every_rig: ClassVar[bool] = False
    """An error of sensor, mount, length or place that every rig has to some degree."""
    world_directed: bool = False
    """The effect has a direction in the world, so that the heading of the housing matters."""
    changes_length: bool = False
    """The rope has another length after the event."""
    instantaneous: ClassVar[bool] = False
    """The event has no duration."""
    profile_modelled: ClassVar[bool] = True
    """False if the exact time course of the event is not modelled: its samples count neither for nor against a model."""
    scales_period: ClassVar[bool] = False
    """The effect changes the rate of the whole motion, as a slow clock does."""
    length_like: ClassVar[bool] = False
    """The effect compensates for a wrong distance along the rope: a nuisance after an event that changed it."""
    coincides_with: ClassVar[str | None] = None
    """The effect with the same signature as long as no length changes: this one is stated beside it and is no rival."""
    needs_temperature: ClassVar[bool] = False
    """Only recordings with a temperature can show the effect."""
    needs_quadrature: ClassVar[bool] = False
    """The reading depends on its own derivative by time, `EvaluationContext.quadrature_g`."""
    hides_small_motion: ClassVar[bool] = False
    """A motion within a dead zone shows little or not at all, so that no fit can start from rest."""
    steady_frequency: bool = False
    """The effect has a parameter `frequency_hz`; residual lines close to it contradict the effect."""
    slow_convergence: ClassVar[bool] = False
    """The parameters lie in a narrow valley of chi-square, so that a fit needs more iterations."""
    segment_s: ClassVar[float] = math.inf
    """The longest segment of multiple shooting that a fit from rest can follow, in s."""
    needs_single_segment: ClassVar[bool] = False
    """The effect has memory that segments of multiple shooting do not carry over."""
    min_duration_s: ClassVar[float] = 0.0
    """The shortest duration for which the search accepts the event, in s."""
    default_guess: ClassVar[Values] = MappingProxyType({})
    """Initial guess of a fit; parameters that it lacks start at their neutral values."""

    @property
    def is_scored(self) -> bool:
        """Whether a score test ranks the effect: by default a persistent one that is linear at its neutral values."""
        if self.transient or self.coincides_with is not None:
            return False
        return self.linear_at_neutral if self.scored is None else self.scored

    @property
    def is_usual(self) -> bool:
        """Whether every rig has the effect to some degree: an error of its own, or a loss."""
        return self.in_every_rig or self.dissipative

    @property
    def is_guessed_from_residual(self) -> bool:
        """Whether the search starts this persistent effect from initial guesses that come from the residual."""
        return not (self.transient or self.is_scored or self.found_before_search or self.coincides_with)

    @property
    def guesses_from_data(self) -> bool:
        """Whether the effect has initial guesses of its own."""
        return type(self).initial_guesses is not Effect.initial_guesses

    # what a fit needs to know

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """Return initial guesses for a fit, the most likely first; none if the data show no sign of the effect.

        By default the time of an event comes from the changepoints, and an effect without a sensitivity at its neutral values
        starts at its typical ones.
        """
        if self.transient:
            names = {kind: self.names_of(kind) for kind in ParameterKind}
            return guess_event(
                context, names[ParameterKind.START], names[ParameterKind.DURATION], names[ParameterKind.EDGE]
            )
        if self.default_guess or self.linear_at_neutral:
            return [self.default_guess]
        return [{p.name: p.typical for p in self.parameters}]

    def names_of(self, kind: ParameterKind) -> tuple[str, ...]:
        """Return the names of the parameters of a kind, in their order."""
        return tuple(p.name for p in self.parameters if p.kind is kind)

    def interval_s(self, values: Values) -> tuple[float, float] | None:
        """Return when an event acts, in s since the first sample of the recording; None for a persistent effect."""
        return self._interval_s(values) if self.transient else None

    def _interval_s(self, values: Mapping[str, Any]) -> tuple[Any, Any]:
        """Return the start of an event and its end, of numbers or of symbols."""
        start_s, duration_s = (
            sum(values[name] for name in self.names_of(kind) if name in values)
            for kind in (ParameterKind.START, ParameterKind.DURATION)
        )
        return start_s, start_s + duration_s

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the parameters for a recording whose first sample is later by this time."""
        starts = self.names_of(ParameterKind.START)
        return {name: float(np.asarray(each)) - by_s if name in starts else each for name, each in values.items()}

    def upper_bound(self, parameter: Parameter, length_m: float) -> float:
        """Return the upper bound of a parameter on a rope of this nominal length."""
        return parameter.upper

    def equivalent_values(self, coincident: Values, length_m: float) -> Values | None:
        """Return the parameters that give the same samples as the effect of `coincides_with` at its parameters.

        None if none do, for instance because of a sign.
        """
        return None

    # what the integration needs to know

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return the longest integration step that follows this effect on a rope of this nominal length."""
        return math.inf

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Return the times at which the effect, or its derivative, is discontinuous; by default the ends of an event."""
        if not self.transient:
            return ()
        start_s, end_s = self._interval_s(p)
        return (start_s,) if self.instantaneous else (start_s, end_s)

    # motion of the load

    def velocity_jump_m_s(self, p: Symbols) -> Vector | None:
        """Return the jump of the load's velocity at the first discontinuity, or None."""
        return None

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Return the lengths with this effect."""
        return geometry

    def rigging(self, p: Symbols) -> Rigging | None:
        """Return the rigging of an effect with the structure RIGGING."""
        return None

    def stretch_acceleration_m_s2(self, p: Symbols, context: EvaluationContext, excess_pull_m_s2: Scalar) -> Scalar:
        """Return the second derivative of the stretch, for the pull along the rope beyond the weight at rest, over the mass."""
        return 0.0

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force on the load divided by its mass."""
        return ZERO_VECTOR

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the acceleration of the pivot."""
        return ZERO_VECTOR

    def pivot_compliance_m(self, p: Symbols) -> Vector | None:
        """Return by how much the pivot gives way under the load's weight as a horizontal pull: xx, xy, yy; None if not at all.

        For effects with the structure YIELDING_PIVOT.
        """
        return None

    def heavy_rope(self, p: Symbols, gravity_m_s2: float, geometry: RopeGeometry) -> HeavyRope | None:
        """Return the rope of an effect with the structure HEAVY_ROPE."""
        return None

    def presliding_rate_rad_s(self, p: Symbols, load: BodyState) -> Vector:
        """Return the derivative of the pre-sliding rotation of the pivot; for effects with the structure PRESLIDING."""
        return ZERO_VECTOR

    # the sensor's chain

    def fictitious_acceleration_m_s2(self, p: Symbols, context: EvaluationContext, housing: BodyState) -> Vector:
        """Return what the sensor measures beyond the acceleration in the pivot's frame, if that frame rotates."""
        return ZERO_VECTOR

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the rotation of the housing about the rope, right-handed about its z axis."""
        return 0.0

    def lever_arm_m(self, p: Symbols) -> tuple[Scalar, Scalar]:
        """Return the place of the accelerometer beside the rope's line, along the housing's x and y axes."""
        return 0.0, 0.0

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Return the sensor's reading of a specific force in g, before its low-pass."""
        return reading

    def output_stage_g(self, p: Symbols, reading: Vector) -> Vector:
        """Return the sensor's output for a filtered reading in g."""
        return reading

    def true_time_s(self, p: Symbols, recorded_s: Scalar) -> Scalar:
        """Return the true time of a recorded time, both since the first sample of the recording."""
        return recorded_s

    # simulated recordings

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Return the samples (n, 3) in g as the sensor delivers them, noise included; for simulated recordings."""
        return force_g

    def keep_samples(self, values: Values, count: int, random: np.random.Generator) -> NDArray[np.bool_] | None:
        """Return which of `count` samples arrive, shape (count,), or None for all; for simulated recordings."""
        return None

    @property
    def acts_on_noisy_samples(self) -> bool:
        """Whether a simulated recording has the effect applied to its noisy samples instead of to the prediction."""
        return (
            type(self).sample_output_g is not Effect.sample_output_g
            or type(self).keep_samples is not Effect.keep_samples
        )
