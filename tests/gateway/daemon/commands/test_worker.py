"""The thread of the commands while the disk hangs: what was begun is answered, what was not is refused, drops are counted."""

import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from devices.host_clock import HostClock
from gateway.daemon.commands import worker as command_worker
from gateway.daemon.commands.requests import RemoteRequest
from gateway.daemon.commands.worker import INBOX, RESERVED, CommandWorker, ProcessedBlock, RecalibrationService
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.storage.calibration_provider import CalibrationProvider
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import Cancel
from tests.waiting import PATIENCE_S, wait_until

AXES = ((0, 1), (1, 1), (2, 1))


class Site:
    """A worker with one handler, which waits for a gate before and after it has begun."""

    def __init__(self, data_dir: Path) -> None:
        self.faults = FaultRegister()
        self.reading, self.writing = threading.Event(), threading.Event()
        self.taken, self.begun = threading.Event(), threading.Event()
        self.changed: list[str] = []
        self.answers: list[tuple[bool, str]] = []
        recalibration = Recalibration(data_dir, AXES, software="test", log_line=lambda _: None)
        service = RecalibrationService(
            recalibration, CalibrationProvider(data_dir, AXES), WallClockMonitor(HostClock()), lambda _: True
        )
        self.worker = CommandWorker(service, {"config_apply": self.apply}, None, self.faults)

    def apply(self, request: RemoteRequest) -> None:
        self.taken.set()
        self.reading.wait(PATIENCE_S)
        try:
            request.begin()
        except TimeoutError as error:
            request.refuse(str(error))
            return
        self.begun.set()
        self.writing.wait(PATIENCE_S)
        self.changed.append(request.expect(Cancel).id)
        request.reply(True, {"text": "done"})

    def submit(self, request_id: str) -> None:
        def reply(accepted: bool, content: Mapping[str, Any]) -> None:
            self.answers.append((accepted, content["text" if accepted else "reason"]))

        self.worker.requests.submit(RemoteRequest("config_apply", Cancel(id=request_id, by="ann"), None, reply))

    def hang(self, reached: threading.Event) -> None:
        """Wait until a request is there, and has been there too long."""
        assert reached.wait(PATIENCE_S)
        wait_until(lambda: time.monotonic() - self.worker.progress_s > command_worker.PATIENCE_S, "the patience to end")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setattr(command_worker, "PATIENCE_S", 0.3)
    made = Site(tmp_path)
    made.worker.start()
    yield made
    made.reading.set()
    made.writing.set()
    made.worker.finish()
    made.worker.join(PATIENCE_S)


@pytest.mark.slow
def test_a_request_for_what_the_disk_does_not_give_is_refused_and_not_carried_out_later(site: Site) -> None:
    site.submit("request-1")
    site.submit("request-2")
    site.hang(site.taken)
    site.worker.refuse_overdue()
    assert site.answers == [(False, "could not be executed: the disk does not answer")] * 2
    site.reading.set()
    site.writing.set()
    site.submit("request-3")
    wait_until(lambda: site.changed, "the next request")
    assert site.changed == ["request-3"]


@pytest.mark.slow
def test_a_request_that_is_being_carried_out_is_answered_however_long_the_disk_takes(site: Site) -> None:
    site.reading.set()
    site.submit("request-1")
    site.hang(site.begun)
    site.worker.refuse_overdue()
    assert site.answers == []
    site.writing.set()
    wait_until(lambda: site.answers, "the answer")
    assert site.answers == [(True, "done")]


@pytest.mark.slow
def test_a_full_inbox_drops_and_counts_blocks_and_keeps_room_for_state_files(site: Site, tmp_path: Path) -> None:
    site.submit("request-1")
    site.hang(site.taken)
    for _ in range(INBOX):
        site.worker.feed(ProcessedBlock(None, "static", 0, 0), 0.0)
    assert site.worker.inbox.dropped == RESERVED
    site.worker.write_soon(tmp_path / "state.json", b"{}")
    site.reading.set()
    site.writing.set()
    wait_until((tmp_path / "state.json").exists, "the file")
    assert site.faults.standing == {}


def test_a_state_that_cannot_be_saved_is_reported_until_it_can(site: Site, tmp_path: Path) -> None:
    (tmp_path / "state.json").mkdir()
    site.worker.write_soon(tmp_path / "state.json", b"{}")
    wait_until(lambda: "cannot be saved" in site.faults.standing.get("state_files", ""), "the fault")
    (tmp_path / "state.json").rmdir()
    site.worker.write_soon(tmp_path / "state.json", b"{}")
    wait_until(lambda: not site.faults.standing, "the fault to go")
