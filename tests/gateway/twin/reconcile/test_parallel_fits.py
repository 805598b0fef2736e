"""Fits in several processes."""

import os
import signal
from collections.abc import Callable
from functools import partial

import pytest

from gateway.twin.model import Model
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.output.serialisation import to_json
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search import context
from gateway.twin.reconcile.search.budget import Budget, FitRequest, run_in_processes
from gateway.twin.reconcile.search.candidates import CandidateTable
from tests.values import present


def _square(number: int) -> int:
    return number * number


def _die() -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def _fail() -> int:
    raise FloatingPointError("as in a fit")


def test_results_come_in_the_order_of_the_tasks() -> None:
    assert run_in_processes([partial(_square, each) for each in range(7)], 3) == [each * each for each in range(7)]


def test_tasks_need_not_be_picklable() -> None:
    parent = os.getpid()
    assert run_in_processes([lambda: os.getpid() != parent, lambda: os.getppid() == parent], 2) == [True, True]


def test_what_a_task_raises_is_raised() -> None:
    with pytest.raises(FloatingPointError, match="as in a fit"):
        run_in_processes([partial(_square, 2), partial(_fail)], 2)


def test_without_its_processes_the_caller_has_no_results() -> None:
    """As after the system has killed one that took too much memory."""
    assert run_in_processes([partial(_die), partial(_square, 2)], 2) == []


def test_as_many_fits_are_made_at_once_as_there_are_processes(
    model: Model, loaded: Callable[..., CheckedRecording], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the third of five turns out to be the last that is needed, one was made in vain and counts nowhere."""
    monkeypatch.setattr(context, "MIN_PARALLEL_WORK", 0.0)
    pools: list[int] = []

    def diverged(tasks: list[Callable[[], object]], processes: int) -> list[object]:
        pools.append(len(tasks))
        return [(None, 7.0)] * len(tasks)

    monkeypatch.setattr(context, "run_in_processes", diverged)
    log, budget = present(loaded({}).observations), Budget(processes=2)
    search = context.make_context(model, log, budget, lambda: None)
    requests = [FitRequest({"rope_length": {"relative_error": 0.01 * each}}) for each in range(5)]
    search.fit_in_turn(CandidateTable(log), requests, lambda _table, _request: budget.fits < 3)

    assert pools == [2, 2]
    assert (budget.fits, budget.work) == (3, 21.0)


@pytest.mark.slow
def test_a_further_guess_is_tried_only_while_nothing_explains_the_log(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    log, budget = present(loaded({"viscous_damping": {"damping_ratio": 0.01}}).observations), Budget()
    search = context.make_context(model, log, budget, lambda: None)
    table = search.fit(CandidateTable(log), {"viscous_damping": {"damping_ratio": 0.01}})
    assert table.is_explained
    guesses = [{"relative_error": 0.01}, {"relative_error": 0.02}]
    search.fit_in_turn(table, search.requests(table, {}, "rope_length", guesses))
    assert budget.fits == 2


@pytest.mark.slow
def test_answer_does_not_depend_on_the_number_of_processes(
    model: Model, loaded: Callable[..., CheckedRecording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(context, "MIN_PARALLEL_WORK", 0.0)
    pools: list[int] = []

    def counted(tasks: list[Callable[[], object]], processes: int) -> list[object]:
        pools.append(len(tasks))
        return run_in_processes(tasks, processes)

    monkeypatch.setattr(context, "run_in_processes", counted)
    hidden = {"viscous_damping": {"damping_ratio": 0.01}, "axis_offset": {"offset_g": (0.004, 0.0, 0.0)}}
    log, held_out = loaded(hidden), loaded(hidden, "held_out")
    one, two = (to_json(reconcile(model, log, held_out, processes=each), 0.0) for each in (1, 2))
    assert one == two
    assert one["verdict"] == "named"
    assert pools
