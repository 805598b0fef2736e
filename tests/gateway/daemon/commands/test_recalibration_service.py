"""The recalibration inside the daemon: the pipeline is told before the answer is sent, and news only where there is some."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.host_clock import HostClock
from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import CalibrationStore
from gateway.daemon.commands.requests import RemoteRequest
from gateway.daemon.commands.worker import PipelineInstruction, ProcessedBlock, RecalibrationService
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.storage.calibration_provider import CalibrationProvider
from gateway.messages import Verdict
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import VERBS, Cancel, Fetch, LoadSignal, RequestError, parse_payload
from gateway.recording.segments.segment import CalibrationFiles
from tests.gateway.conftest import record_content
from tests.values import present

INFO = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0)


class TurnedClock(HostClock):
    """Gateway time that a test turns."""

    passed_ns = 0

    def now_ns(self) -> int:
        return 1_767_225_600_000_000_000 + self.passed_ns


@pytest.fixture
def clock() -> TurnedClock:
    return TurnedClock()


def make_service(
    data_dir: Path, clock: TurnedClock, attach: Callable[[CalibrationFiles | None], bool] = lambda _: True
) -> RecalibrationService:
    axes = ((0, 1), (1, 1), (2, 1))
    recalibration = Recalibration(data_dir, axes, software="test", log_line=lambda _: None)
    return RecalibrationService(recalibration, CalibrationProvider(data_dir, axes), WallClockMonitor(clock), attach)


@pytest.fixture
def service(tmp_path: Path, clock: TurnedClock) -> RecalibrationService:
    made = make_service(tmp_path, clock)
    made.open(INFO)
    return made


@pytest.fixture
def slow_sync(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A disk whose every sync takes 0.25 s; the descriptors that were synced."""
    synced: list[int] = []

    def sync(descriptor: int) -> None:
        time.sleep(0.25)
        synced.append(descriptor)

    monkeypatch.setattr(os, "fsync", sync)
    return synced


def told(service: RecalibrationService) -> PipelineInstruction:
    return present(service.instruction)


def ask(service: RecalibrationService, verb: str, request_id: str, **content: Any) -> tuple[bool, PipelineInstruction]:
    """Whether the request was accepted, and what the pipeline had been told by then."""
    answers: list[tuple[bool, PipelineInstruction]] = []
    request = VERBS[verb].model_validate({"id": request_id, "by": "ann", **content})
    service.carry_out(
        RemoteRequest(verb, request, None, lambda accepted, _content: answers.append((accepted, told(service))))
    )
    (answer,) = answers
    return answer


def rest(
    service: RecalibrationService, clock: TurnedClock, seconds: float, verdict: Verdict | None = None, changes: int = 0
) -> int:
    """Let the housing rest; the number of new instructions meanwhile."""
    known, news = told(service), 0
    for _ in range(int(seconds * 10)):
        clock.passed_ns += 100_000_000
        time_ns = clock.now_ns() + np.arange(10) * 10_000_000
        block = SampleBlock(time_ns=time_ns, raw=np.full((10, 3), [1, 2, 1000], dtype=np.int32))
        service.feed(ProcessedBlock(block, verdict, int(time_ns[-1]), changes))
        service.tick()
        known, news = told(service), news + (told(service) is not known)
    return news


def test_a_session_is_told_at_each_change_and_twice_a_second(service: RecalibrationService, clock: TurnedClock) -> None:
    first = told(service)
    service.tick()
    assert told(service) is first
    accepted, known = ask(service, "recalibrate", "request-1", housing_off_rope=True)
    assert accepted
    assert known.session.suspended
    assert known.changes == first.changes + 1
    assert 20 <= rest(service, clock, 10.0) <= 30
    assert told(service).changes == known.changes
    assert told(service).session.poses[0].face == "+z"
    _, known = ask(service, "cancel", "request-2")
    assert (known.session.phase, known.session.suspended) == ("rejected", False)
    assert rest(service, clock, 5.0) == 0


def test_requests_before_a_device_is_open_are_refused(tmp_path: Path, clock: TurnedClock) -> None:
    answers: list[Any] = []
    service = make_service(tmp_path, clock)
    for verb, content in (("cancel", Cancel(id="request-1", by="ann")), ("fetch", Fetch())):
        serve = service.fetch if verb == "fetch" else service.carry_out
        serve(RemoteRequest(verb, content, None, lambda _accepted, content: answers.append(content["reason"])))
    assert answers == ["no device has been opened yet"] * 2


def test_the_record_is_attached_to_the_recording_until_the_recorder_takes_it(
    tmp_path: Path, clock: TurnedClock
) -> None:
    offered: list[str | None] = []

    def attach(files: CalibrationFiles | None) -> bool:
        offered.append(None if files is None else files.record_id)
        return len(offered) != 2

    CalibrationStore(tmp_path, INFO.device_id).add(CalibrationRecord.model_validate(record_content(id="r1")))
    service = make_service(tmp_path, clock, attach)
    service.tick()
    service.open(INFO)
    service.tick()
    ask(service, "rollback", "request-1", to="r1")
    assert offered == [None]  # the answer is not delayed
    for _ in range(3):
        service.tick()
    assert offered == [None, "r1", "r1"]


def test_a_verdict_from_before_the_last_change_does_not_count(
    service: RecalibrationService, clock: TurnedClock
) -> None:
    rest(service, clock, 1.0, "static")
    assert ask(service, "recalibrate", "request-1")[0]
    ask(service, "cancel", "request-2")
    rest(service, clock, 1.0, "static", changes=told(service).changes - 1)
    assert not ask(service, "recalibrate", "request-3")[0]
    rest(service, clock, 1.0, "static", changes=told(service).changes)
    assert ask(service, "recalibrate", "request-4")[0]


@pytest.mark.slow
def test_a_commit_on_a_slow_disk_is_carried_out(
    service: RecalibrationService, tmp_path: Path, slow_sync: list[int]
) -> None:
    """Each sync takes longer than the 0.2 s after which a commit was refused while the processing thread waited for it."""
    store = CalibrationStore(tmp_path, INFO.device_id)
    store.add(CalibrationRecord.model_validate(record_content(id="r1", device_id=INFO.device_id)))
    accepted, known = ask(service, "rollback", "request-1", to="r1")
    assert accepted
    assert known.correction.calibration_id == "r1"
    assert len(slow_sync) > 2


def test_a_load_signal_refuses_a_recalibration(service: RecalibrationService) -> None:
    service.set_load_signal(parse_payload(LoadSignal, b'{"loaded": true, "load_kg": 1250.0}'))
    service.tick()
    assert not ask(service, "recalibrate", "request-1", housing_off_rope=True)[0]
    service.set_load_signal(parse_payload(LoadSignal, b'{"loaded": false}'))  # it may be anybody's
    service.tick()
    assert not ask(service, "recalibrate", "request-2", housing_off_rope=True)[0]


def test_a_signal_of_no_load_permits_a_recalibration(service: RecalibrationService) -> None:
    service.set_load_signal(parse_payload(LoadSignal, b'{"loaded": false}'))
    service.tick()
    assert ask(service, "recalibrate", "request-1", housing_off_rope=True)[0]


@pytest.mark.parametrize("payload", [b"", b"5", b'{"loaded": "yes"}', b"\xff", b"[" * 8000])
def test_an_invalid_load_signal_is_refused(payload: bytes) -> None:
    with pytest.raises(RequestError):
        parse_payload(LoadSignal, payload)
