"""A disk that hangs costs the thread that writes a moment, and nothing of what failed is carried out later."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from gateway.daemon.disk_executor import PATIENCE_S, DiskExecutor
from gateway.daemon.faults import FaultRegister
from tests.waiting import wait_until


@pytest.fixture
def disk() -> Iterator[DiskExecutor]:
    made = DiskExecutor(FaultRegister())
    made.start()
    yield made
    made.finish()
    made.join(5)


def test_a_job_is_done_when_the_call_returns(disk: DiskExecutor) -> None:
    assert disk.perform(lambda is_wanted: is_wanted()) is True


def test_an_error_is_that_of_the_job(disk: DiskExecutor) -> None:
    def fail(_is_wanted: Callable[[], bool]) -> None:
        raise PermissionError("no")

    with pytest.raises(PermissionError, match="no"):
        disk.perform(fail)


def test_a_job_that_hangs_fails_soon_and_is_not_finished_later(disk: DiskExecutor) -> None:
    gate, finished = threading.Event(), list[bool]()

    def hang(is_wanted: Callable[[], bool]) -> None:
        gate.wait(30)
        finished.append(is_wanted())

    begun_s = time.monotonic()
    with pytest.raises(TimeoutError):
        disk.perform(hang)
    with pytest.raises(TimeoutError):
        disk.perform(lambda is_wanted: finished.append(True))  # at once, while the other one hangs
    assert time.monotonic() - begun_s < 10 * PATIENCE_S
    gate.set()
    wait_until(lambda: finished, "the job to go on")
    assert finished == [False]
    wait_until(lambda: works(disk), "the disk to be used again")
    assert finished == [False]


def works(disk: DiskExecutor) -> bool:
    try:
        disk.perform(lambda is_wanted: None)
    except TimeoutError:
        return False
    return True
