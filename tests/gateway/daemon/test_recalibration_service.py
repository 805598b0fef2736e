"""The service between the bus and the processing thread: bounded, and news only where there is some."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.clock import HostClock
from gateway.daemon.recalibration_service import WAITING, RecalibrationService, ServiceUpdate
from gateway.daemon.remote_request import RemoteRequest
from gateway.daemon.wall_clock import WallClockMonitor
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import VERBS, LoadSignal, RequestError, parse_payload

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


def ask(service: RecalibrationService, verb: str, request_id: str, **content: Any) -> list[bool]:
    """The answers, once there are any: whether the request was accepted."""
    answers: list[bool] = []
    request = VERBS[verb].model_validate({"id": request_id, "by": "ann", **content})
    service.submit(RemoteRequest(verb, request, None, lambda accepted, _content: answers.append(accepted)))
    return answers


def rest(service: RecalibrationService, clock: TurnedClock, seconds: float) -> Iterator[bool]:
    for _ in range(int(seconds * 10)):
        clock.passed_ns += 100_000_000
        time_ns = clock.now_ns() + np.arange(10) * 10_000_000
        service.feed(SampleBlock(time_ns=time_ns, raw=np.full((10, 3), [1, 2, 1000], dtype=np.int32)))
        yield service.serve().session_due


def test_one_request_is_answered_per_block_and_a_bounded_number_waits(service: RecalibrationService) -> None:
    answers = [ask(service, "cancel", f"request-{number}") for number in range(WAITING)]
    assert ask(service, "cancel", "one-too-many") == [False]
    assert service.dropped == 1
    assert not any(answers)
    for served in range(1, WAITING + 1):
        service.serve()
        assert [len(answer) for answer in answers] == [1] * served + [0] * (WAITING - served)


def test_a_session_is_published_at_each_change_and_twice_a_second(
    service: RecalibrationService, clock: TurnedClock
) -> None:
    assert service.serve() == ServiceUpdate(pipeline_changed=False, session_due=False)
    (answers,) = [ask(service, "recalibrate", "request-1", housing_off_rope=True)]
    assert service.serve() == ServiceUpdate(pipeline_changed=True, session_due=True)
    assert answers == [True]
    assert not service.serve().pipeline_changed
    assert service.suspended is not None
    news = sum(rest(service, clock, 10.0))
    assert service.session.poses[0].face == "+z"
    assert 20 <= news <= 30
    ask(service, "cancel", "request-2")
    assert service.serve().session_due
    assert service.session.phase == "rejected"
    assert sum(rest(service, clock, 5.0)) == 0


def test_a_load_signal_refuses_a_recalibration(service: RecalibrationService) -> None:
    service.set_load_signal(parse_payload(LoadSignal, b'{"loaded": true, "load_kg": 1250.0}'))
    answers = ask(service, "recalibrate", "request-1", housing_off_rope=True)
    service.serve()
    assert answers == [False]
    service.set_load_signal(parse_payload(LoadSignal, b'{"loaded": false}'))
    answers = ask(service, "recalibrate", "request-2", housing_off_rope=True)
    service.serve()
    assert answers == [True]


@pytest.mark.parametrize("payload", [b"", b"5", b'{"loaded": "yes"}', b"\xff", b"[" * 8000])
def test_an_invalid_load_signal_is_refused(payload: bytes) -> None:
    with pytest.raises(RequestError):
        parse_payload(LoadSignal, payload)
