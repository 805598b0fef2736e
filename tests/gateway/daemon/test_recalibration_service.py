"""The desk between the bus and the processing thread: bounded, and news only where there is some."""

import json
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.clock import HostClock
from gateway.daemon.recalibration_service import WAITING, PendingRequest, RecalibrationService
from gateway.daemon.wall_clock import WallClockWatch
from gateway.recalibration.journal import Answer
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.standard import StandardMethods

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
def desk(tmp_path: Path, clock: TurnedClock) -> RecalibrationService:
    methods = StandardMethods(((0, 1), (1, 1), (2, 1)))
    recalibration = Recalibration(tmp_path, methods, software="test", tell=lambda _: None)
    made = RecalibrationService(recalibration, WallClockWatch(clock))
    made.open(INFO)
    return made


def ask(desk: RecalibrationService, verb: str, request_id: str, **content: Any) -> list[Answer]:
    answers: list[Answer] = []
    payload = json.dumps({"id": request_id, "by": "ann", **content}).encode()
    assert desk.submit(PendingRequest(verb, payload, answers.append))
    return answers


def rest(desk: RecalibrationService, clock: TurnedClock, seconds: float) -> Iterator[bool]:
    for _ in range(int(seconds * 10)):
        clock.passed_ns += 100_000_000
        time_ns = clock.now_ns() + np.arange(10) * 10_000_000
        desk.take(SampleBlock(time_ns=time_ns, raw=np.full((10, 3), [1, 2, 1000], dtype=np.int32)))
        desk.serve()
        yield desk.has_changed()


def test_requests_wait_for_the_processing_thread_within_bounds(desk: RecalibrationService) -> None:
    answers = [ask(desk, "cancel", f"request-{number}") for number in range(WAITING)]
    assert not desk.submit(PendingRequest("cancel", b"", lambda _answer: None))
    assert desk.dropped == 1
    assert not any(answers)
    desk.serve()
    assert [answer.accepted for (answer,) in answers] == [False] * WAITING


def test_a_session_is_told_of_at_each_change_and_twice_a_second(desk: RecalibrationService, clock: TurnedClock) -> None:
    assert not desk.has_changed()
    assert not desk.serve()
    (answers,) = [ask(desk, "recalibrate", "request-1", housing_off_rope=True)]
    assert desk.serve()
    assert answers[0].accepted
    assert not desk.serve()
    assert desk.suspended is not None
    assert desk.has_changed()
    news = sum(rest(desk, clock, 10.0))
    assert desk.view.poses[0].face == "+z"
    assert 20 <= news <= 30
    ask(desk, "cancel", "request-2")
    desk.serve()
    assert desk.has_changed()
    assert desk.view.phase == "rejected"
    assert sum(rest(desk, clock, 5.0)) == 0


def test_a_load_on_the_hook_is_heard(desk: RecalibrationService, clock: TurnedClock) -> None:
    desk.set_load_signal(b'{"loaded": true, "load_kg": 1250.0}')
    (answers,) = [ask(desk, "recalibrate", "request-1", housing_off_rope=True)]
    desk.serve()
    assert "a load hangs" in answers[0].text
    desk.set_load_signal(b'{"loaded": false}')
    (answers,) = [ask(desk, "recalibrate", "request-2", housing_off_rope=True)]
    desk.serve()
    assert answers[0].accepted


@pytest.mark.parametrize("payload", [b"", b"5", b'{"loaded": "yes"}', b"\xff"])
def test_a_load_signal_that_is_none_is_said_and_survived(
    desk: RecalibrationService, payload: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR, logger="plumbline.recalibration"):
        logging.getLogger("plumbline").propagate = True
        desk.set_load_signal(payload)
        desk.serve()
    assert "load signal" in caplog.text
