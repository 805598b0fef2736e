"""Fits in several processes, and steps of the search that leave no better set beside theirs untried."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.output.serialisation import to_json
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search import context
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import Budget, FitRequest, make_context, run_in_processes
from gateway.twin.reconcile.search.search import try_swaps
from gateway.twin.reconcile.search.steps import fit_persistent_effects
from tests.gateway.twin.reconcile.conftest import RATE_HZ, RIG, swing
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
    hidden = {"viscous_damping": {"damping_ratio": 0.01}}
    log, held_out = loaded(hidden), loaded(hidden, "held_out")
    one, two = (to_json(reconcile(model, log, held_out, processes=each), 0.0) for each in (1, 2))
    assert one == two
    assert one["verdict"] == "named"
    assert pools


@pytest.mark.slow
def test_rivals_of_a_set_are_tried_with_the_effect_that_a_swap_brought_in() -> None:
    """A wide swing at the pivot in coarse noise, as from a video: beside the wrong loss a loose clamp looks like a length."""
    rig = replace(RIG, length_m=0.65, position_m=0.0, noise_g=(0.01,) * 3)
    hidden: EffectValues = {"quadratic_drag": {"drag_per_m": 0.025}, "rope_length": {"relative_error": 0.032}}
    quiet, time_s = replace(rig, noise_g=(0.007,) * 3), np.arange(0, 40.0, 1 / RATE_HZ)
    log = replace(swing(quiet, hidden, [1.1, 0.7, 0.0, 0.0, 0.0], time_s, seed=5), noise_g=np.array(rig.noise_g))
    context = make_context(Model(rig, {}), log, Budget(), lambda: None)
    table = CandidateTable(log)
    for names in ((), ("viscous_damping", "housing_rocking"), ("viscous_damping", "rope_length")):
        table = context.fit(table, {name: {} for name in names})
    table = table.start_round()
    before = table.fits[frozenset({"viscous_damping", "housing_rocking"})]

    table, _ = try_swaps(table, context, before)

    # A clock's rate is that of a length here, and the two are told as a group.
    assert any(table.get({"quadratic_drag", each}) is not None for each in ("rope_length", "clock_drift"))
    assert table.best.names & {"rope_length", "clock_drift"}


@pytest.mark.slow
def test_a_length_that_is_wrong_by_a_fifth_is_fitted_from_that_of_the_period() -> None:
    """From the stated length a swing of 21 degrees loses the phase; a score says nothing of so wrong a length either."""
    hidden: EffectValues = {"viscous_damping": {"damping_ratio": 0.005}, "rope_length": {"relative_error": -0.2}}
    log = swing(RIG, hidden, [0.33, 0.15, -0.02, 0.05, 0.0], np.arange(0, 60.0, 1 / RATE_HZ), seed=0)
    context = make_context(Model(RIG, {}), log, Budget(), lambda: None)
    table = fit_persistent_effects(context.fit(CandidateTable(log), {}).start_round(), context)

    assert table.best.names == {"rope_length"}
    assert table.best.values["rope_length"]["relative_error"] == pytest.approx(-0.2, abs=5e-3)
