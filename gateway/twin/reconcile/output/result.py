"""What a reconciliation found: JSON, text and report are made from these.

Residual is measured - simulated; sigma is the believed noise of the rig, per sample and axis. Times count from the
recording's first sample. chi-square is reduced: 1 is noise alone. Lone spikes count nowhere.

A cause outside the vocabulary shows by what is left of the motion: a reading that is not linear in what it measures leaves lines
at multiples of the swing's frequency along the swing, a second support or a tilted axis across it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.parameter import Value, Values
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput

Direction = Literal["along the swing", "across the swing", "along the rope"]
DIRECTIONS: tuple[Direction, ...] = ("along the swing", "across the swing", "along the rope")
UNEQUAL = 1.5
"""Ratio of the shares in wide and small swings from which on both are told."""
MULTIPLES = ("", "twice ", "three times ", "four times ")
CAUSES: dict[tuple[Direction, int], str] = {
    ("along the swing", 1): "a length, a loss or a clock that changes with the amplitude or in time",
    (
        "along the swing",
        2,
    ): "a reading that is not linear (an angle sensor, the perspective of a camera), or a load that rocks",
    ("across the swing", 1): "a suspension that is stiffer to one side, or a swing that turns",
    ("across the swing", 2): "a second support, a tilted axis, or a sensor askew",
    ("along the rope", 1): "a housing askew on the rope, or a pivot that moves",
    ("along the rope", 2): "the housing's place, the scale of the axis along the rope, or a rope that stretches",
}
"""What is typical of a direction and a multiple of the swing's frequency, 2 standing for all from there on."""
SLOW_CAUSE = "a zero or a mount that drifts, or wind"
"""Of a line at less than half the swing's frequency."""
OTHER_CAUSE = "another body or a second mode, a machine, or wind"
"""Of a line at no multiple."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter of a named effect."""

    value: Value
    ci95: tuple[Value, Value]
    unit: str
    meaning: str
    plausible: bool
    """Inside its physical bounds, not resting on one, and within what a part or a mount can have."""
    limit: float | None = None
    """Largest size that a part or a mount can have; None where there is no such limit."""
    stated: Value | None = None
    """What the rig states; None where its model does not have the effect."""
    components: tuple[str, ...] = ()
    """Names of the components; empty for a single number."""
    refitted: bool = False
    """It belongs to the recording and not to the rig."""

    @property
    def unit_text(self) -> str:
        """The unit; empty for a pure number."""
        return "" if self.unit == "1" else self.unit


@dataclass(frozen=True, slots=True)
class NamedEffect:
    """An effect that the data hold."""

    name: str
    explains: str
    equation: str
    parameters: Mapping[str, Estimate]
    when_s: tuple[float, float] | None
    """When a transient effect acted."""

    @property
    def is_stated(self) -> bool:
        """Whether the rig's model has the effect, with other values."""
        return any(each.stated is not None for each in self.parameters.values())


@dataclass(frozen=True, slots=True)
class Resemblance:
    """An effect of the vocabulary beside a term of a law."""

    name: str
    cosine: float
    """Of the angle between the signatures, the initial motion projected out; 1 is the same signature."""
    reversed: bool
    """It would need a negative size, which it cannot have."""


@dataclass(frozen=True, slots=True)
class LawTerm:
    """A term of the law of what no effect explains."""

    name: str
    text: str
    """The term with numbers and units: `force/mass = +0.0042 1/s v`."""
    meaning: str
    """The same in an operator's words."""
    parameters: Mapping[str, Estimate]
    alternatives: tuple[str, ...]
    """Other terms that describe the data nearly as well, the closest first."""
    closest_effects: tuple[Resemblance, ...]
    """Effects of the vocabulary whose signature is the most similar."""


@dataclass(frozen=True, slots=True)
class Law:
    """What no effect of the vocabulary explains, as terms of an equation: a description, no cause."""

    terms: tuple[LawTerm, ...]
    beside: tuple[str, ...]
    """Effects of the vocabulary that are part of the same model."""
    closed_test_percent: float | None
    """Share of the gap on the test part that the law closes beside them."""

    @property
    def text(self) -> str:
        """All terms with their meanings."""
        return "; ".join(f"{term.text} ({term.meaning})" for term in self.terms)


@dataclass(frozen=True, slots=True)
class Remainder:
    """What is left of the motion in the log."""

    share: float
    """Rms of the residual over that of the readings about their mean, both without the noise."""
    share_before: float
    """The same by the nominal model."""
    share_wide_swing: float
    share_small_swing: float
    """The same in the half of the log where the swing is wider, and in the other."""
    direction: Direction
    """That of most of the residual's power."""
    hz: float | None
    """Frequency of the strongest line in that direction; None where none stands out."""
    amplitude_g: float | None
    multiple_of_swing: int | None
    """Of the swing's frequency, 1 to 4; None where the line is at none."""
    is_slow: bool = False
    """The line is at less than half the swing's frequency."""

    @property
    def where(self) -> str:
        """The direction, and the frequency where a line stands out."""
        if self.hz is None:
            return f"{self.direction}, at no single frequency"
        if self.multiple_of_swing is None:
            return f"{self.direction} at {self.hz:.3g} Hz"
        return f"{self.direction} at {MULTIPLES[self.multiple_of_swing - 1]}its frequency"

    @property
    def typical_cause(self) -> str:
        """What leaves such a remainder; empty where no line stands out."""
        if self.hz is None:
            return ""
        if self.is_slow:
            return SLOW_CAUSE
        return OTHER_CAUSE if self.multiple_of_swing is None else CAUSES[self.direction, min(self.multiple_of_swing, 2)]

    @property
    def sentence(self) -> str:
        """How much is left, where, and what is typical of it."""
        if not self.share:
            return "nothing of the motion in the log beyond the noise, but something in the data that the model was tested on"
        text = f"{percent(self.share)} of the motion is left ({percent(self.share_before)} by the nominal model)"
        text += f", mostly {self.where}"
        if self.amplitude_g is not None:
            text += f", {self.amplitude_g * 1e3:.3g} mg"
        lesser, greater = sorted((self.share_wide_swing, self.share_small_swing))
        if greater > UNEQUAL * lesser > 0:
            wide, small = percent(self.share_wide_swing), percent(self.share_small_swing)
            text += f"; {wide} where the swing is wide, {small} where it is small"
        return f"{text}; typical of {self.typical_cause}" if self.typical_cause else text


def percent(share: float) -> str:
    """Return a share in percent, to two digits."""
    return f"{float(f'{100 * share:.2g}'):g} %"


Array = NDArray[np.float64]
AVERAGED = "averaged"
"""Key of the counts: samples to one mean."""
Verdict = Literal["data_unusable", "none_missing", "named", "one_of", "named_with_remainder", "unmodelled"]


@dataclass(frozen=True, slots=True)
class Curves:
    """One recording against two models of it."""

    time_s: Array
    """Shape (n,)."""
    measured_g: Array
    """Shape (n, 3): x, y, z of the housing."""
    before_g: Array
    """Simulated by the model as believed, initial motion fitted, shape (n, 3)."""
    after_g: Array
    """Simulated by the final model, shape (n, 3)."""
    used: NDArray[np.bool_]
    """False for lone spikes, shape (n,)."""
    noise_g: Array
    """Shape (3,)."""
    offset_s: float = 0.0
    """From the first sample of the recording to the first sample here; not 0 for a later part of a recording."""

    @property
    def recording_time_s(self) -> Array:
        """Times since the first sample of the recording, shape (n,)."""
        return self.time_s + self.offset_s

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last time since the first sample of the recording."""
        return float(self.time_s[0]) + self.offset_s, float(self.time_s[-1]) + self.offset_s

    @property
    def residuals_sigma(self) -> tuple[Array, Array]:
        """What the model as believed and the final one leave, in sigma, 0 where a sample does not count, shape (n, 3) each."""
        weight = self.used[:, None] / self.noise_g
        return self.residual_before_g * weight, self.residual_after_g * weight

    @property
    def residual_before_g(self) -> Array:
        """Measured - simulated by the model as believed, shape (n, 3)."""
        return self.measured_g - self.before_g

    @property
    def residual_after_g(self) -> Array:
        """Measured - simulated by the final model, shape (n, 3)."""
        return self.measured_g - self.after_g


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Where the believed model and the data part."""

    axis: str
    """x, y or z."""
    from_s: float
    to_s: float
    band_hz: tuple[float, float]
    rms_sigma: float


@dataclass(frozen=True, slots=True)
class Candidate:
    """A set of effects that was fitted, with its evidence."""

    names: tuple[str, ...]
    chi2_log: float
    """Reduced."""
    chi2_held_out: float | None
    """Reduced; None where it was not judged there."""
    bic: float
    """Chi-square over the noise's colour, + parameters x ln(numbers)."""
    behind: float
    """Evidence by which it falls behind the best: BIC on the log and, where judged, chi-square on held-out; 0 for the best."""
    rival: bool
    """Explains the data as well as the best."""


@dataclass(frozen=True, slots=True)
class Equivalent:
    """An effect that gives the same period as one of the answer, and the same samples but for a structure of its own.

    Recordings in which no length changes separate the two by the sag or the ringing of such a structure alone.
    """

    name: str
    of: str
    """The effect of the answer."""
    parameters: Values
    """The values at which it does."""
    split_by: str
    """The measurement or manoeuvre that separates the two."""

    @property
    def gives_same_samples(self) -> bool:
        """Whether no sample differs; else the period alone is the same."""
        return EFFECTS[self.name].structure is ModelStructure.ROPE


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the search."""

    added: tuple[str, ...]
    dropped: tuple[str, ...]
    names: tuple[str, ...]
    """The model after it."""
    gap_log: float
    gap_held_out: float
    bic: float


@dataclass(frozen=True, slots=True)
class Gap:
    """Reduced chi-square of the residual, by the nominal model (before) and by the final one (after)."""

    before_log: float
    before_held_out: float
    """Of the whole held-out recording, selection and test part."""
    before_test: float
    """Of the test part, on which no choice rested: the gap to quote."""
    after_log: float
    after_held_out: float
    after_test: float
    test_interval: tuple[float, float]
    """95 % block-bootstrap interval of the decrease of the reduced chi-square on the test part."""

    @staticmethod
    def closed_percent(before: float, after: float) -> float | None:
        """100 (before - after)/(before - 1), at most 100: a stated noise that is too large leaves less than 1.

        None where nothing was open.
        """
        return None if before <= 1.0 else min(100.0, 100 * (before - after) / (before - 1))


@dataclass(frozen=True, slots=True)
class DataPart:
    """A part of the data and what it served."""

    role: Literal["fit", "selection", "test"]
    recording: Literal["log", "held_out"]
    blocks_s: tuple[tuple[float, float], ...]
    """From and to, since the first sample of the recording as given."""
    samples: int


@dataclass(frozen=True, slots=True)
class Peak:
    """A line in what remains."""

    hz: float
    axis: str
    amplitude_g: float
    multiple_of_swing: int | None = None
    """Of the swing's frequency, 1 to 4; None where the line is at none."""


@dataclass(frozen=True, slots=True)
class Residual:
    """What the final model leaves."""

    white: bool
    ljung_box_p: float
    peaks: tuple[Peak, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """How the nominal and the final model follow the data."""

    log: Curves
    held_out: Curves
    """Of a second recording, or of the end of LOG."""
    held_out_is_last_third: bool
    parts: tuple[DataPart, ...]
    """Which part of the data the models were fitted to, selected by and tested on."""
    disagreement: tuple[Disagreement, ...]
    gap: Gap
    residual: Residual
    remainder: Remainder
    """What the final model leaves of the motion."""


@dataclass(frozen=True, slots=True)
class Reconciliation:
    """The answer."""

    verdict: Verdict
    reason: str
    """One sentence: why this verdict; for data_unusable what is wrong and what would do."""
    reason_code: str
    """The same as a constant word."""
    rig: TwinRig
    counts: Mapping[str, int]
    """Samples read, used, lone spikes, lost, repeated, invalid; of a long recording, `AVERAGED` of them to one mean."""
    model: EffectValues
    """`[model.*]` of the final model, those that the rig had before included."""
    comparison: Comparison | None = None
    """None where no model was fitted."""
    effects: tuple[NamedEffect, ...] = ()
    candidates: tuple[str, ...] = ()
    """Names that explain the data equally well, where the verdict is one_of."""
    candidate_sets: tuple[tuple[str, ...], ...] = ()
    """How candidates act together where one alone does not explain the data; empty where each does."""
    also_one_of: tuple[tuple[str, ...], ...] = ()
    """Further groups of candidates, of each of which one effect acts as well."""
    equivalents: tuple[Equivalent, ...] = ()
    """Effects that coincide with named ones or with candidates."""
    split_by: str | None = None
    steps: tuple[Step, ...] = ()
    ranking: tuple[Candidate, ...] = ()
    equations_before: tuple[str, ...] = ()
    equations_after: tuple[str, ...] = ()
    refitted_on_held_out: tuple[str, ...] = ()
    inputs: tuple[EstimatedInput, ...] = ()
    """What the crane did in the log, where that is taken as known."""
    held_out_inputs: tuple[EstimatedInput, ...] = ()
    """The same in a second recording; empty where the end of the log is held out."""
    leaves_remainder: bool = False
    """Something is left that neither an effect of the answer nor one of a group explains."""
    ended_early: bool = False
    """The search was ended before it had tried all that it would have: other effects may explain the data as well."""
    law: Law | None = None
    """What describes the remainder where no effect explains it; part of the final model."""

    @property
    def alternatives(self) -> tuple[str, ...]:
        """The candidates, those that act together as one: `a with b`."""
        return tuple(" with ".join(each) for each in self.candidate_sets) or self.candidates

    @property
    def best_attempt(self) -> EffectValues:
        """The effects of the best model, where it does not explain the data: they have no claim to be the cause."""
        if self.verdict != "unmodelled":
            return {}
        law = set() if self.law is None else {term.name for term in self.law.terms}
        return {name: values for name, values in self.model.items() if name not in law}
