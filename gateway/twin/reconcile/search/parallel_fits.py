"""Independent computations in several processes."""

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
from gateway.twin.reconcile.fit.fit_context import SEARCH_ITERATIONS

Array = NDArray[np.float64]
T = TypeVar("T")
MAX_PROCESSES = 4
"""Processes that are used unless more are asked for: each takes some 150 MB."""
_tasks: list[Callable[[], Any]] = []
"""The tasks of the pool that is being started: its processes are forked and inherit them."""


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
    iterations: int = SEARCH_ITERATIONS
    give_up_above: float = np.inf
    held_by_parts: bool = False
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
