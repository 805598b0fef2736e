"""The budget of a search: how many fits, how much integration and time it may spend, and in how many processes."""

import os
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gateway.twin.model import EffectValues
from gateway.twin.reconcile.fit.least_squares import FIT_ITERATIONS
from gateway.twin.simulator.compiled_model import IntegrationError

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

    def add_fit(self, work: float) -> None:
        """Count a fit that the search used."""
        self.fits += 1
        self.work += work

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
