"""The outcome of a search: what was found and decided, and how the nominal and the final model follow the data."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.stats import true_runs
from gateway.twin.effects.sensor_output import Quantization, SampleLoss
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.crane_inputs import merge_spans
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.recordings import Recordings, selection_part, test_part
from gateway.twin.reconcile.data.sensor import quantised_mean_g
from gateway.twin.reconcile.decision.evidence import RankedCandidate
from gateway.twin.reconcile.decision.verdict import Decision
from gateway.twin.reconcile.equation.selection import FoundLaw
from gateway.twin.reconcile.output.result import Curves, DataPart, Gap
from gateway.twin.reconcile.search.search import SearchRun
from gateway.twin.reconcile.search.validation import block_bootstrap_gain, evaluate_on_validation

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """A search, what was decided of its sets of effects, and the law of what they leave."""

    run: SearchRun
    ranked: list[RankedCandidate]
    decision: Decision
    ended_early: bool
    """The search was ended before it had tried all that it would have."""
    law: FoundLaw | None = None
    """The law of what no effect explains; part of the decision's model."""

    @property
    def rig(self) -> TwinRig:
        """The nominal rig."""
        return self.run.known.model.rig

    @property
    def model(self) -> EffectValues:
        """All effects of the final model."""
        lost = self.run.lost_fraction
        sample_loss: EffectValues = {} if lost is None else {SampleLoss.name: {"fraction": lost}}
        return {**self.run.known.model.effects, **self.decision.model.candidate.values, **sample_loss}

    def log_curves(self) -> Curves:
        """The log at its true times, simulated by the nominal and the final model."""
        final = self.decision.model.candidate
        return self._curves(self.run.recordings.log, self.run.nominal.fit.force_g, final.fit.force_g)

    def held_out_curves(self) -> Curves:
        """The held-out recording as stamped: which samples are lost there cannot be predicted."""
        run, as_stamped = self.run, self.run.recordings.held_out_as_stamped
        before, after = run.validator.evaluate(run.nominal), self.decision.model.validation
        if run.lost_fraction is not None:
            selection = selection_part(as_stamped, run.recordings.block_s)
            nominal, limits = run.validator.effects_of(run.nominal), run.validator.limits_of(run.nominal)
            before = evaluate_on_validation(self.rig, nominal, selection, limits=limits)
            after = evaluate_on_validation(self.rig, self.model, selection)
        return self._curves(as_stamped, before.fit.force_g, after.fit.force_g)

    def _curves(self, observations: Observations, before_g: Array, after_g: Array) -> Curves:
        """Of the final model with the steps of the readings, where it has them."""
        noise_g, values = np.array(self.rig.noise_g), self.decision.model.candidate.values
        if Quantization.name in values:
            step_g = float(np.asarray(values[Quantization.name]["lsb_g"]))
            after_g = quantised_mean_g(after_g, step_g, noise_g)
        time_s, measured_g = observations.time_s, observations.force_g
        return Curves(time_s, measured_g, before_g, after_g, observations.used, noise_g, observations.offset_s)


def measure_gap(log: Curves, held_out: Curves, recordings: Recordings, random: np.random.Generator) -> Gap:
    """Return reduced chi-square on the log, on the whole held-out recording and on its test part, before and after."""
    in_test = test_part(recordings.held_out_as_stamped, recordings.block_s).used
    log_before, log_after = _reduced_chi2(log, log.used)
    held_before, held_after = _reduced_chi2(held_out, held_out.used)
    test_before, test_after = _reduced_chi2(held_out, in_test)
    before, after = (each[in_test] for each in held_out.residuals_sigma)
    interval = block_bootstrap_gain(before, after, float(np.median(np.diff(held_out.time_s))), random)
    return Gap(log_before, held_before, test_before, log_after, held_after, test_after, interval)


def _reduced_chi2(curves: Curves, used: NDArray[np.bool_]) -> tuple[float, float]:
    before, after = (float(np.mean(each[used] ** 2)) for each in curves.residuals_sigma)
    return before, after


def list_data_parts(recordings: Recordings) -> tuple[DataPart, ...]:
    """Return what each part of the data served; times count from the first sample of the recording as given."""
    log, held_out, block_s = recordings.log, recordings.held_out_as_stamped, recordings.block_s
    recording: Literal["log", "held_out"] = "log" if recordings.last_third else "held_out"
    selection, test = selection_part(held_out, block_s), test_part(held_out, block_s)
    return (
        DataPart("fit", "log", ((0.0, log.duration_s),), int(log.used.sum())),
        DataPart("selection", recording, _blocks_s(selection, block_s), int(selection.used.sum())),
        DataPart("test", recording, _blocks_s(test, block_s), int(test.used.sum())),
    )


def _blocks_s(part: Observations, block_s: float) -> tuple[tuple[float, float], ...]:
    ends_s = part.time_s + part.offset_s
    spans_s = [(float(ends_s[first]), float(ends_s[stop - 1])) for first, stop in true_runs(part.used)]
    return tuple(merge_spans(spans_s, block_s / 2))  # a spike left out does not end a block
