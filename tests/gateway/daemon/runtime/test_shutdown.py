"""The end of the threads: one that works off its queue is waited for, one that hangs is not, and a signal shortens both."""

import threading
import time

import pytest

from gateway.daemon.runtime import supervision
from gateway.daemon.runtime.supervision import STOP_S, Shutdown
from gateway.daemon.runtime.worker import BoundedQueue, Worker
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

STEP_S = 0.05


class Steps(Worker[float]):
    """Takes as long for each item as that says."""

    def __init__(self, *steps_s: float) -> None:
        super().__init__("steps", BoundedQueue(64))
        self.done = 0
        self.released = threading.Event()
        for step_s in steps_s:
            self.inbox.put(step_s)
        self.finish()
        self.start()

    def handle(self, item: float) -> None:
        self.released.wait(item)
        self.done += 1

    def close(self) -> None:
        pass


def test_a_slow_thread_that_progresses_is_waited_for() -> None:
    worker = Steps(*[STEP_S] * 40)
    shutdown = Shutdown(threading.Event())
    shutdown.drain(worker, 30 * STEP_S, STOP_S)
    assert worker.done == 40
    assert shutdown.stuck == []


def test_a_thread_that_hangs_is_named() -> None:
    worker = Steps(STEP_S, STEP_S, 60.0)
    shutdown = Shutdown(threading.Event())
    begun_s = time.monotonic()
    shutdown.drain(worker, 10 * STEP_S, STOP_S)
    assert time.monotonic() - begun_s < 30
    assert shutdown.stuck == ["steps"]
    worker.released.set()


@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_a_signal_leaves_time_for_the_threads_after(delay_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervision, "STOP_S", PATIENCE_S)
    worker, signalled = Steps(*[STEP_S] * 600), threading.Event()
    threading.Timer(delay_s, signalled.set).start()
    shutdown = Shutdown(signalled)
    begun_s = time.monotonic()
    shutdown.drain(worker, 60.0, 0.5, kept_s=PATIENCE_S - 0.5)
    assert 0.5 <= time.monotonic() - begun_s < PATIENCE_S / 2
    assert shutdown.stuck == ["steps"]
    worker.released.set()


def test_after_a_signal_a_thread_that_gets_on_is_waited_for_and_one_that_hangs_is_not() -> None:
    signalled = threading.Event()
    signalled.set()
    shutdown = Shutdown(signalled)
    busy, hung = Steps(*[STEP_S] * 30), Steps(60.0)
    shutdown.drain(busy, 60.0, 20 * STEP_S)
    shutdown.drain(hung, 60.0, 20 * STEP_S)
    assert busy.done == 30
    assert shutdown.stuck == ["steps"]
    assert hung.is_alive()
    hung.released.set()


def test_a_signal_bounds_the_wait_for_all_threads() -> None:
    first, second, signalled = Steps(60.0), Steps(60.0), threading.Event()
    signalled.set()
    shutdown = Shutdown(signalled)
    begun_s = time.monotonic()
    shutdown.join(first, 60.0)
    shutdown.drain(second, 60.0, STOP_S)
    assert time.monotonic() - begun_s < 2 * STOP_S
    assert shutdown.stuck == ["steps", "steps"]
    for worker in (first, second):
        worker.released.set()
