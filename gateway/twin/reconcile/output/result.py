"""What a reconciliation found: JSON, text and report are made from these.

Residual is measured - simulated; sigma is the believed noise of the rig, per sample and axis. Times count from the
recording's first sample. chi-square is reduced: 1 is noise alone. Lone spikes count nowhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.parameter import Values
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.output.estimates import Law, NamedEffect, Remainder

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
