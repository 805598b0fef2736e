"""What all steps of a search share: the recording, the budget of fits and of work, and results that are computed once."""

import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing import get_context
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import Values
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.multiple_shooting import FIT_ITERATIONS
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable, make_candidate
from gateway.twin.reconcile.search.changepoints import locate_changepoint
from gateway.twin.reconcile.search.signatures import Signatures, compute_signatures, scorable_effects
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES, IntegrationError

Array = NDArray[np.float64]
T = TypeVar("T")
MAX_FITS = 60
"""Fits after which what is still missing is no single effect and no pair: searches that end with a name make 10 to 45."""
MAX_WORK = 1.6e8
"""Derivatives of states and readings in fits, some 20 s on one core of a desk; searches that end with a name spend half of it."""
MAX_PROCESSES = 4
"""Processes that are used unless more are asked for: each takes some 150 MB."""
_tasks: list[Callable[[], Any]] = []
"""The tasks of the pool that is being started: its processes are forked and inherit them."""


class OutOfTimeError(IntegrationError):
    """The search is over: the fit that runs is given up like one that diverges."""


@dataclass(slots=True)
class Budget:
    """Counts what a search has spent; the same recording and rig always spend the same, unless it is ended early."""

    max_fits: int = MAX_FITS
    max_work: float = MAX_WORK
    processes: int = 1
    """Processes for fits that do not depend on each other."""
    is_over: Callable[[], bool] = lambda: False
    """Whether somebody wants the best answer so far."""
    fits: int = 0
    work: float = 0.0
    work_per_evaluation: float = 0.0
    work_of_fit: float = 0.0
    """Of the fit that is running, or ended last."""

    @property
    def is_exhausted(self) -> bool:
        """Whether the search has to end with what it has."""
        return self.fits >= self.max_fits or self.work >= self.max_work or self.is_over()

    @property
    def spent_share(self) -> float:
        """Share of the budget that is spent, 0 to 1; most searches end before it is 1."""
        return min(max(self.fits / self.max_fits, (self.work + self.work_of_fit) / self.max_work), 1.0)

    def begin_fit(self, work_per_evaluation: float) -> None:
        """Note what each evaluation of a fit costs. Raises `OutOfTimeError` as `count_evaluation` does."""
        self._end_if_over()
        self.work_per_evaluation, self.work_of_fit = work_per_evaluation, 0.0

    def count_evaluation(self) -> None:
        """Count one linearisation of the model. Raises `OutOfTimeError` where the search is over and has an answer."""
        self._end_if_over()
        self.work_of_fit += self.work_per_evaluation

    def _end_if_over(self) -> None:
        if self.fits and self.is_over():
            raise OutOfTimeError


def usable_processes() -> int:
    """Return the number of processes that this machine runs at once, at most `MAX_PROCESSES`; 1 where it cannot fork."""
    if not hasattr(os, "fork"):
        return 1
    return min(len(os.sched_getaffinity(0)), MAX_PROCESSES)


def run_in_processes(tasks: Sequence[Callable[[], T]], processes: int) -> list[T]:
    """Return the results of tasks; nothing where a process dies, so that the caller computes them itself.

    Results are pickled, tasks are not. What a task raises is raised here.
    """
    _tasks[:] = tasks
    with ProcessPoolExecutor(min(processes, len(tasks)), mp_context=get_context("fork")) as pool:
        try:
            with warnings.catch_warnings():
                # Threads of the linear algebra library are started anew in each process.
                warnings.simplefilter("ignore", DeprecationWarning)
                return list(pool.map(_run, range(len(tasks))))
        except BrokenProcessPool:
            return []
        finally:
            pool.shutdown(cancel_futures=True)


def _run(index: int) -> Any:
    return _tasks[index]()


@dataclass(frozen=True, slots=True)
class FitRequest:
    """The arguments of a fit."""

    values: EffectValues
    """Effects of the set, at the values from which they are fitted."""
    starts: Array | None = None
    """Initial states of the segments (segments, states)."""
    iterations: int = FIT_ITERATIONS
    give_up_above: float = np.inf
    is_further_guess: bool = False
    """It is tried only while nothing explains the log."""


def values_key(values: EffectValues) -> tuple[object, ...]:
    """Return what makes two sets of values the same."""
    return tuple(
        sorted(
            (name, tuple(sorted((key, tuple(np.atleast_1d(np.asarray(each)).tolist())) for key, each in own.items())))
            for name, own in values.items()
        )
    )


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

    def without_eliminated(self, table: CandidateTable, best: CandidateFit) -> "SearchContext":
        """The same without the baseline effects that backward elimination removed: no rival has to have them."""
        kept = {name: values for name, values in self.baseline_effects.items() if name in best.values}
        return self if table.get(kept) is None else replace(self, baseline_effects=kept)

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

        left, at_once = list(requests), 1
        if min(self.budget.processes, len(requests)) > 1:
            work = max(self.setting.work_per_evaluation(each.values) for each in requests)
            at_once = self.budget.processes if work >= MIN_PARALLEL_WORK else 1
        while left := [each for each in left if is_wanted(each)]:
            batch, left = left[:at_once], left[at_once:]
            tasks = [partial(self._make, each) for each in batch]
            made = run_in_processes(tasks, self.budget.processes) if len(tasks) > 1 else []
            for request, (found, work) in zip(batch, made or [task() for task in tasks], strict=True):
                if is_wanted(request):
                    self.budget.fits, self.budget.work = self.budget.fits + 1, self.budget.work + work
                    table = table if found is None else table.with_fit(found)
        return table

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
        structures = {EFFECTS[each].structure for each in (name, *others)} - {ModelStructure.ROPE}
        if name in others or name in self.setting.crane_inputs or len(structures) > 1:
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
            starts = self.segment_starts(parent) if self.setting.log.has_large_amplitude else None
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


def make_context(model: Model, log: Observations, budget: Budget, on_evaluation: Callable[[], None]) -> SearchContext:
    """Make the context of a search on a log; `on_evaluation` is called at each evaluation of a model."""

    def count() -> None:
        budget.count_evaluation()
        on_evaluation()

    return SearchContext(FitContext(model.rig, model.effects, log, count), budget)
