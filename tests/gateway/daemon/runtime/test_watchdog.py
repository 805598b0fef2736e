"""The watchdog is fed while every required thread makes progress, and a thread that hangs is named."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.daemon.runtime.supervision import Watchdog
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.service_state import ServiceNotifier
from tests.waiting import wait_until

PATIENCE_S = 0.5


class Gated(Worker[threading.Event]):
    """Waits for each event that it is given."""

    def handle(self, item: threading.Event) -> None:
        item.wait()

    def close(self) -> None:
        pass


class Breaking(Gated):
    def handle(self, item: threading.Event) -> None:
        raise ZeroDivisionError("a defect")


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[tuple[socket.socket, ServiceNotifier]]:
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.bind(str(path))
        bound.setblocking(False)
        notifier = ServiceNotifier({"NOTIFY_SOCKET": str(path)})
        yield bound, notifier
        notifier.close()


def fed(manager: socket.socket, check: Callable[[], object]) -> bool:
    check()
    try:
        return manager.recv(100) == b"WATCHDOG=1"
    except BlockingIOError:
        return False


def started(name: str, kind: type[Gated] = Gated) -> Gated:
    worker = kind(name, BoundedQueue(8))
    worker.start()
    return worker


@pytest.mark.slow
def test_an_idle_thread_makes_progress(manager: tuple[socket.socket, ServiceNotifier]) -> None:
    bound, notifier = manager
    worker = started("recorder")
    watchdog = Watchdog({worker: PATIENCE_S}, (), notifier, FaultRegister())
    time.sleep(2 * PATIENCE_S)
    wait_until(lambda: fed(bound, watchdog.check), "the feeding")
    worker.finish()


@pytest.mark.slow
def test_one_hung_thread_stops_the_feeding_and_is_named_until_it_goes_on(
    manager: tuple[socket.socket, ServiceNotifier],
) -> None:
    bound, notifier = manager
    workers, gate, faults = [started(name) for name in ("processor", "recorder")], threading.Event(), FaultRegister()
    watchdog = Watchdog(dict.fromkeys(workers, PATIENCE_S), (), notifier, faults)
    wait_until(lambda: fed(bound, watchdog.check), "the feeding")
    workers[1].inbox.put(gate)
    wait_until(lambda: watchdog.check() == {workers[1]}, "the hung thread to be noticed")
    while fed(bound, lambda: None):
        pass
    assert not fed(bound, watchdog.check)
    assert "the recorder thread has made no progress" in faults.standing["recorder"]
    gate.set()
    wait_until(lambda: fed(bound, watchdog.check), "the thread to go on")
    assert faults.standing == {}
    for worker in workers:
        worker.finish()


def test_an_optional_thread_that_has_ended_is_named_and_does_not_restart_the_gateway(
    manager: tuple[socket.socket, ServiceNotifier],
) -> None:
    bound, notifier = manager
    required, optional, faults = started("processor"), started("rpc"), FaultRegister()
    watchdog = Watchdog({required: PATIENCE_S}, (optional,), notifier, faults)
    optional.finish()
    optional.join()
    wait_until(lambda: fed(bound, watchdog.check), "the feeding")
    assert list(faults.standing) == ["rpc"]
    required.finish()


@pytest.mark.filterwarnings("error")
def test_a_defect_costs_the_item_and_not_the_thread() -> None:
    worker = started("compaction", Breaking)
    for _ in range(3):
        worker.inbox.put(threading.Event())
    wait_until(lambda: worker.defects == 3, "three defects")
    assert worker.is_alive()
    worker.finish()
