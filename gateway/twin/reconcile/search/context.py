"""What all steps of a search share: the recording, the budget, and results that are computed once."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import Values
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.least_squares import FIT_ITERATIONS
from gateway.twin.reconcile.search.budget import Budget, FitRequest, run_in_processes
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable, make_candidate
from gateway.twin.reconcile.search.changepoints import locate_changepoint
from gateway.twin.reconcile.search.signatures import Signatures, compute_signatures, scorable_effects
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

Array = NDArray[np.float64]
MIN_PARALLEL_WORK = 5e4
"""Derivatives in one linearisation from which fits are worth a process: some 0.1 s for a fit."""


@dataclass(slots=True)
class SearchContext:
    """The log as it is fitted, what every candidate contains, and caches of what depends on a set of effects alone."""

    setting: FitContext
    budget: Budget
    baseline_effects: EffectValues = field(default_factory=dict)
    """Effects found without a search: every candidate contains them."""
    _changepoints: dict[tuple[frozenset[str], bool], EventWindow | None] = field(default_factory=dict)
    _signatures: dict[frozenset[str], Signatures] = field(default_factory=dict)
    _segment_starts: dict[frozenset[str], Array] = field(default_factory=dict)

    def with_baseline(self, baseline_effects: EffectValues) -> "SearchContext":
        """The same recording and budget with other baseline effects."""
        return replace(self, baseline_effects=baseline_effects)

    def without_eliminated(self, table: CandidateTable, best: CandidateFit) -> "SearchContext":
        """The same without the baseline effects that backward elimination removed: no rival has to have them."""
        kept = {name: values for name, values in self.baseline_effects.items() if name in best.values}
        return self if table.get(kept) is None else self.with_baseline(kept)

    def fit(
        self, table: CandidateTable, values: EffectValues, starts: Array | None = None, iterations: int = FIT_ITERATIONS
    ) -> CandidateTable:
        """Fit a set of effects from these values; the table stays as it is where the fit diverges."""
        return self.fit_in_turn(table, [FitRequest(values, starts, iterations)])

    def fit_apart(self, values: EffectValues) -> CandidateFit | None:
        """Return a fit of a set of effects that no table has yet; None where it diverges."""
        return self.fit(CandidateTable(self.setting.log), values).get(values)

    def fit_in_turn(
        self,
        table: CandidateTable,
        requests: Sequence[FitRequest],
        is_needed: Callable[[CandidateTable, FitRequest], bool] = lambda _table, _request: True,
    ) -> CandidateTable:
        """Make fits in this order, as many at once as there are processes; a fit that diverges leaves the table as it is.

        Before each one the table decides whether it is still needed, a further guess only while nothing explains the log. So the
        answer does not depend on the number of processes.
        """

        def is_wanted(request: FitRequest) -> bool:
            is_spare = request.is_further_guess and (self.budget.is_exhausted or table.is_explained)
            return not is_spare and is_needed(table, request)

        left, at_once = list(requests), self._at_once(requests)
        while left := [each for each in left if is_wanted(each)]:
            batch, left = left[:at_once], left[at_once:]
            for request, (found, work) in zip(batch, self._make_at_once(batch), strict=True):
                if is_wanted(request):
                    self.budget.add_fit(work)
                    table = table if found is None else table.with_fit(found)
        return table

    def _at_once(self, requests: Sequence[FitRequest]) -> int:
        """Return how many of these fits are worth processes of their own."""
        if min(self.budget.processes, len(requests)) < 2:
            return 1
        work = max(self.setting.work_per_evaluation(each.values) for each in requests)
        return self.budget.processes if work >= MIN_PARALLEL_WORK else 1

    def _make_at_once(self, requests: Sequence[FitRequest]) -> list[tuple[CandidateFit | None, float]]:
        """Return fits, None where one diverged, each with its work."""
        tasks = [partial(self._make, each) for each in requests]
        made = run_in_processes(tasks, self.budget.processes) if len(tasks) > 1 else []
        return made or [task() for task in tasks]

    def _make(self, request: FitRequest) -> tuple[CandidateFit | None, float]:
        values = request.values
        try:
            self.budget.begin_fit(self.setting.work_per_evaluation(values))
            fit = self.setting.fit(values, request.starts, request.iterations, request.give_up_above)
        except INTEGRATION_FAILURES:
            return None, self.budget.work_of_fit
        return make_candidate(self.setting, values, fit), self.budget.work_of_fit

    def guesses(self, name: str, parent: CandidateFit) -> Sequence[Values]:
        """Return initial guesses of an effect from what a fitted set of effects leaves."""
        residual_g = self.setting.log.force_g - parent.fit.force_g
        return EFFECTS[name].initial_guesses(self.setting.guess_context(residual_g))

    def requests(
        self,
        table: CandidateTable,
        others: EffectValues,
        name: str,
        guesses: Iterable[Values],
        starts: Array | None = None,
    ) -> list[FitRequest]:
        """Return the fits of an effect beside others, one for each guess; none where it cannot be beside them.

        One that the rig states starts from there: what is missing is its change.
        """
        if name in others or name in self.setting.crane_inputs or _excludes_each_other(name, others):
            return []
        stated = self.setting.stated_effects.get(name)
        guesses = guesses if stated is None else [stated]
        tried: list[EffectValues] = [{**others, name: values or EFFECTS[name].default_guess} for values in guesses]
        if name == DoublePendulum.name and tried and stated is None:
            tried = [self.setting.best_of_guesses(tried)]
        return [
            FitRequest(values, starts, give_up_above=table.give_up_above, is_further_guess=index > 0)
            for index, values in enumerate(tried)
        ]

    def segment_starts(self, parent: CandidateFit) -> Array:
        """Initial conditions of each segment under a fitted set of effects, to fit its neighbours from."""
        if parent.names not in self._segment_starts:
            self._segment_starts[parent.names] = self.setting.segment_starts(parent.values)
        return self._segment_starts[parent.names]

    def signatures(self, parent: CandidateFit) -> Signatures:
        """Signatures of all scorable effects beside a fitted set of effects."""
        if parent.names not in self._signatures:
            names = scorable_effects(self.setting)
            starts = self.segment_starts(parent) if self.setting.large_amplitude else None
            self._signatures[parent.names] = compute_signatures(
                self.setting, parent.fit, parent.values, names, segment_starts=starts
            )
        return self._signatures[parent.names]

    def changepoints(self, parent: CandidateFit, *, length: bool) -> EventWindow | None:
        """Interval between the motion before an event and the one after it; with `length` the rope may change in it.

        None beside known inputs of the crane: a motion extrapolated over an input that is not fitted is no evidence.
        """
        if self.setting.crane_inputs:
            return None
        key = (parent.names, length)
        if key not in self._changepoints:
            self._changepoints[key] = locate_changepoint(self.setting, parent.values, length=length)
        return self._changepoints[key]


def _excludes_each_other(name: str, others: Iterable[str]) -> bool:
    """Whether effects give the model different structures."""
    structures = {EFFECTS[each].structure for each in (name, *others)} - {ModelStructure.ROPE}
    return len(structures) > 1


def make_context(model: Model, log: Observations, budget: Budget, on_evaluation: Callable[[], None]) -> SearchContext:
    """Make the context of a search on a log; `on_evaluation` is called at each evaluation of a model."""

    def count() -> None:
        budget.count_evaluation()
        on_evaluation()

    return SearchContext(FitContext(model.rig, model.effects, log, count), budget)
