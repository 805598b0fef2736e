"""What the daemon owes its surroundings: the service manager, the data folder, the clock."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from devices.host_clock import HostClock
from gateway.daemon.runtime.host import STEP_NS, WallClockMonitor
from gateway.daemon.runtime.instance import FolderError, InstanceError, InstanceLock
from gateway.service_state import ServiceNotifier
from tests.values import present


def test_the_notifier_sends_to_the_managers_socket(tmp_path: Path) -> None:
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(path))
        manager.settimeout(5)
        notifier = ServiceNotifier({"NOTIFY_SOCKET": str(path)})
        notifier.send("WATCHDOG=1")
        assert manager.recv(100) == b"WATCHDOG=1"
        notifier.close()


def test_the_notifier_accepts_abstract_addresses() -> None:
    name = f"plumbline-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("\0" + name)
        manager.settimeout(5)
        notifier = ServiceNotifier({"NOTIFY_SOCKET": "@" + name})
        notifier.send("READY=1")
        assert manager.recv(100) == b"READY=1"
        notifier.close()


def test_the_notifier_ignores_a_missing_manager(tmp_path: Path) -> None:
    ServiceNotifier({}).send("READY=1")
    notifier = ServiceNotifier({"NOTIFY_SOCKET": str(tmp_path / "nobody")})
    notifier.send("READY=1")
    notifier.close()


def locked(folder: Path) -> InstanceLock:
    lock = InstanceLock(folder)
    lock.acquire()
    return lock


def test_one_gateway_per_data_folder(tmp_path: Path) -> None:
    first = locked(tmp_path / "data")
    first.acquire()  # a second time changes nothing
    with pytest.raises(InstanceError, match=rf"in use by another gateway \(process {os.getpid()}\)"):
        locked(tmp_path / "data")
    first.release()
    locked(tmp_path / "data").release()


def test_the_lock_of_a_killed_process_is_free(tmp_path: Path) -> None:
    code = (
        "import sys, pathlib; sys.path.insert(0, '.');"
        "from gateway.daemon.runtime.instance import InstanceLock;"
        "lock = InstanceLock(pathlib.Path(sys.argv[1])); lock.acquire(); print('held', flush=True); sys.stdin.read()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with process:
        assert present(process.stdout).readline() == "held\n"
        with pytest.raises(InstanceError):
            locked(tmp_path)
        process.kill()
        process.wait()
        locked(tmp_path).release()


def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FolderError, match="cannot be written"):
        locked(tmp_path / "file" / "data")


def test_a_folder_is_locked_as_soon_as_it_can_be_made(tmp_path: Path) -> None:
    blocking = tmp_path / "file"
    blocking.write_text("")
    lock = InstanceLock(blocking / "data")
    with pytest.raises(FolderError):
        lock.acquire()
    blocking.unlink()
    lock.acquire()
    with pytest.raises(InstanceError):
        locked(blocking / "data")


class SteppingClock(HostClock):
    """A host whose wall clock jumps."""

    offset_ns = 0

    def wall_offset_ns(self) -> int:
        return self.offset_ns


def test_steps_of_the_wall_clock_are_counted() -> None:
    clock = SteppingClock()
    watch = WallClockMonitor(clock)
    watch.poll()
    assert watch.steps == 0
    clock.offset_ns = STEP_NS // 2
    watch.poll()
    assert watch.steps == 0
    clock.offset_ns = 3600 * 10**9
    assert watch.poll().wall_offset_ns == 3600 * 10**9
    assert watch.steps == 1
