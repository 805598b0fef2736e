"""What all steps of a search share: the recording, the budget, and results that are computed once."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import Model
from gateway.twin.reconcile.changepoints.changepoint import locate_changepoint, locate_next_changepoint
from gateway.twin.reconcile.changepoints.consistent_prefix import ConsistentPrefix
from gateway.twin.reconcile.changepoints.pre_event_candidates import effects_extending_consistent_prefix
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import SEARCH_ITERATIONS, FitContext
from gateway.twin.reconcile.search.budget import Budget
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable, make_candidate
from gateway.twin.reconcile.search.parallel_fits import FitRequest, run_in_processes
from gateway.twin.reconcile.search.score_test import Signatures, compute_signatures, scorable_effects
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
REFINE_ITERATIONS = 20
"""Iterations of a fit that continues along a narrow valley of chi-square."""
MIN_PARALLEL_WORK = 5e4
"""Derivatives in one linearisation from which fits are worth a process: some 0.1 s for a fit."""


@dataclass(slots=True)
class SearchContext:
    """The log as it is fitted, what every candidate contains, and caches of what depends on a set of effects alone."""

    setting: FitContext
    budget: Budget
    baseline_effects: Values = field(default_factory=dict)
    """Effects found without a search: every candidate contains them."""
    _ahead: dict[tuple[object, ...], tuple[CandidateFit | None, float]] = field(default_factory=dict)
    """Fits that were made before the search asks for them, with their work."""
    _announced: dict[tuple[object, ...], FitRequest] = field(default_factory=dict)
    """Fits that the search may ask for next, in this order."""
    _changepoints: dict[tuple[frozenset[str], bool], EventWindow | None] = field(default_factory=dict)
    _prefixes: dict[frozenset[str], list[ConsistentPrefix]] = field(default_factory=dict)
    _signatures: dict[frozenset[str], Signatures] = field(default_factory=dict)
    _segment_starts: dict[frozenset[str], Array] = field(default_factory=dict)

    def with_baseline(self, baseline_effects: Values) -> "SearchContext":
        """The same recording and budget with other baseline effects."""
        return replace(self, baseline_effects=baseline_effects)

    def without_eliminated(self, table: CandidateTable, best: CandidateFit) -> "SearchContext":
        """The same without the baseline effects that backward elimination removed: no rival has to have them."""
        kept = {name: values for name, values in self.baseline_effects.items() if name in best.values}
        return self if table.get(kept) is None else self.with_baseline(kept)

    def fit(
        self,
        table: CandidateTable,
        values: Values,
        starts: Array | None = None,
        iterations: int = SEARCH_ITERATIONS,
        give_up_above: float = np.inf,
        *,
        held_by_parts: bool = False,
    ) -> CandidateTable:
        """Fit a set of effects from these values; the table stays as it is where the fit diverges."""
        return self.fit_requested(table, FitRequest(values, starts, iterations, give_up_above, held_by_parts))

    def fit_requested(self, table: CandidateTable, request: FitRequest) -> CandidateTable:
        """Fit as a request says, if that was not done ahead; the table stays as it is where the fit diverges."""
        self._make_announced(request)
        known = self._ahead.pop(request.key, None) if self._ahead else None
        if known is None:
            found = self._make(request)
        else:
            found, work = known
            self.budget.add_fit(work)
        return table if found is None else table.with_fit(found)

    def fit_ahead(self, requests: Sequence[FitRequest]) -> None:
        """Make fits at once that the search is about to ask for one after the other; what it does not ask for is dropped."""
        self.announce(())
        self._make_at_once(requests)

    def announce(self, requests: Sequence[FitRequest]) -> None:
        """Say which fits the search asks for next until one explains the log: as many are made at once as there are processes."""
        self._ahead.clear()
        self._announced = {each.key: each for each in requests}

    def _make_announced(self, request: FitRequest) -> None:
        if request.key not in self._announced:
            return
        keys = list(self._announced)
        at_once = keys[keys.index(request.key) :][: self.budget.processes]
        self._make_at_once([self._announced.pop(key) for key in at_once])

    def _make_at_once(self, requests: Sequence[FitRequest]) -> None:
        if min(self.budget.processes, len(requests)) < 2:
            return
        if max(self.setting.work_per_evaluation(each.values) for each in requests) < MIN_PARALLEL_WORK:
            return
        made = run_in_processes([partial(self._make_counted, each) for each in requests], self.budget.processes)
        self._ahead.update((each.key, outcome) for each, outcome in zip(requests, made, strict=False))

    def _make(self, request: FitRequest) -> CandidateFit | None:
        values = request.values
        self.budget.begin_fit(self.setting.work_per_evaluation(values))
        try:
            fit = self.setting.fit(
                values,
                request.starts,
                request.iterations,
                request.give_up_above,
                held_by_parts=request.held_by_parts,
            )
        except INTEGRATION_FAILURES:
            return None
        return make_candidate(self.setting, values, fit)

    def _make_counted(self, request: FitRequest) -> tuple[CandidateFit | None, float]:
        before = self.budget.work
        return self._make(request), self.budget.work - before

    def fit_first_that_explains(
        self,
        table: CandidateTable,
        others: Values,
        name: str,
        guesses: Iterable[Mapping[str, Value]],
        starts: Array | None = None,
    ) -> CandidateTable:
        """Fit an effect beside others from one guess after another, until one of them explains the log."""
        tried = list(guesses)
        if name == DoublePendulum.name and tried and self._may_be_beside(name, others):
            several = [{**others, name: values} for values in tried]
            tried = [self.setting.fit_rigging_length(several)[name]]
        requests = self.requests(table, others, name, tried, starts)
        if len(requests) > 1 and not {each.key for each in requests} & {*self._announced, *self._ahead}:
            self.announce(requests)
        for index, request in enumerate(requests):
            if index and (self.budget.is_exhausted or table.is_explained):
                break
            table = self.fit_requested(table, request)
        return table

    def requests(
        self,
        table: CandidateTable,
        others: Values,
        name: str,
        guesses: Iterable[Mapping[str, Value]],
        starts: Array | None = None,
    ) -> list[FitRequest]:
        """Return the fits of an effect beside others, one for each guess; none where it cannot be beside them."""
        return [
            FitRequest(
                {**others, name: values or EFFECTS[name].default_guess}, starts, give_up_above=table.give_up_above
            )
            for values in (guesses if self._may_be_beside(name, others) else ())
        ]

    def _may_be_beside(self, name: str, others: Values) -> bool:
        return not (name in others or name in self.setting.model_effects or _excludes_each_other(name, others))

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

    def changepoints_after(self, prefix: ConsistentPrefix, *, length: bool) -> EventWindow | None:
        """The same after a consistent prefix that is known."""
        key = (frozenset(prefix.values), length)
        if key not in self._changepoints:
            self._changepoints[key] = locate_next_changepoint(self.setting, prefix, length=length)
        return self._changepoints[key]

    def prefixes(self, parent: CandidateFit) -> list[ConsistentPrefix]:
        """Beginnings of the log that one further persistent effect makes a single trajectory, best first."""
        if parent.names not in self._prefixes:
            names = scorable_effects(self.setting)
            self._prefixes[parent.names] = effects_extending_consistent_prefix(self.setting, parent.values, names)
        return self._prefixes[parent.names]


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
