"""The service between the bus and the processing thread: bounded, and news only where there is some."""

import json
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.clock import HostClock
from gateway.daemon.recalibration_service import WAITING, PendingRequest, RecalibrationService, ServiceUpdate
from gateway.daemon.wall_clock import WallClockMonitor
from gateway.recalibration.journal import RequestAnswer
from gateway.recalibration.recalibration import Recalibration

INFO = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0)


class TurnedClock(HostClock):
    """Gateway time that a test turns."""

    passed_ns = 0

    def now_ns(self) -> int:
        return 1_767_225_600_000_000_000 + self.passed_ns


@pytest.fixture
def clock() -> TurnedClock:
    return TurnedClock()


@pytest.fixture
def service(tmp_path: Path, clock: TurnedClock) -> RecalibrationService:
    axes = ((0, 1), (1, 1), (2, 1))
    recalibration = Recalibration(tmp_path, axes, software="test", log_line=lambda _: None)
    made = RecalibrationService(recalibration, WallClockMonitor(clock))
    made.open(INFO)
    return made


def ask(service: RecalibrationService, verb: str, request_id: str, **content: Any) -> list[RequestAnswer]:
    answers: list[RequestAnswer] = []
    payload = json.dumps({"id": request_id, "by": "ann", **content}).encode()
    assert service.submit(PendingRequest(verb, payload, answers.append))
    return answers


def rest(service: RecalibrationService, clock: TurnedClock, seconds: float) -> Iterator[bool]:
    for _ in range(int(seconds * 10)):
        clock.passed_ns += 100_000_000
        time_ns = clock.now_ns() + np.arange(10) * 10_000_000
        service.feed(SampleBlock(time_ns=time_ns, raw=np.full((10, 3), [1, 2, 1000], dtype=np.int32)))
        yield service.serve().session_due


def test_a_bounded_number_of_requests_waits_for_the_processing_thread(service: RecalibrationService) -> None:
    answers = [ask(service, "cancel", f"request-{number}") for number in range(WAITING)]
    assert not service.submit(PendingRequest("cancel", b"", lambda _answer: None))
    assert service.dropped == 1
    assert not any(answers)
    service.serve()
    assert [answer.accepted for (answer,) in answers] == [False] * WAITING


def test_a_session_is_published_at_each_change_and_twice_a_second(
    service: RecalibrationService, clock: TurnedClock
) -> None:
    assert service.serve() == ServiceUpdate(pipeline_changed=False, session_due=False)
    (answers,) = [ask(service, "recalibrate", "request-1", housing_off_rope=True)]
    assert service.serve() == ServiceUpdate(pipeline_changed=True, session_due=True)
    assert answers[0].accepted
    assert not service.serve().pipeline_changed
    assert service.suspended is not None
    news = sum(rest(service, clock, 10.0))
    assert service.session.poses[0].face == "+z"
    assert 20 <= news <= 30
    ask(service, "cancel", "request-2")
    assert service.serve().session_due
    assert service.session.phase == "rejected"
    assert sum(rest(service, clock, 5.0)) == 0


def test_a_load_signal_refuses_a_recalibration(service: RecalibrationService, clock: TurnedClock) -> None:
    service.set_load_signal(b'{"loaded": true, "load_kg": 1250.0}')
    (answers,) = [ask(service, "recalibrate", "request-1", housing_off_rope=True)]
    service.serve()
    assert "a load hangs" in answers[0].text
    service.set_load_signal(b'{"loaded": false}')
    (answers,) = [ask(service, "recalibrate", "request-2", housing_off_rope=True)]
    service.serve()
    assert answers[0].accepted


@pytest.mark.parametrize("payload", [b"", b"5", b'{"loaded": "yes"}', b"\xff"])
def test_an_invalid_load_signal_is_reported(
    service: RecalibrationService, payload: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR, logger="plumbline.recalibration"):
        logging.getLogger("plumbline").propagate = True
        service.set_load_signal(payload)
        service.serve()
    assert "load signal" in caplog.text
