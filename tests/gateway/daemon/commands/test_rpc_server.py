"""What the bus brings while the thread of the remote calls is busy: bounded, and every drop is counted."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from devices.host_clock import HostClock
from gateway.authorization.message_signature import MessageSigner
from gateway.daemon.commands.requests import RequestDispatcher
from gateway.daemon.commands.rpc_server import INBOX, RESERVED_FOR_ANSWERS, RpcServer, SignInWatch
from gateway.daemon.commands.security import SecurityLog, refuse_all
from gateway.daemon.commands.worker import RecalibrationService
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.storage.calibration_provider import CalibrationProvider
from gateway.recalibration.recalibration import Recalibration
from tests.waiting import wait_until

KEY = "plumbline/v1/site/crane/hook"
AXES = ((0, 1), (1, 1), (2, 1))


@pytest.fixture
def session() -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", json.dumps([]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as opened:
        yield opened


@pytest.fixture
def recalibration(tmp_path: Path) -> Recalibration:
    return Recalibration(tmp_path, AXES, software="test", log_line=print)


@pytest.fixture
def service(recalibration: Recalibration, tmp_path: Path) -> RecalibrationService:
    calibrations = CalibrationProvider(tmp_path, AXES)
    return RecalibrationService(recalibration, calibrations, WallClockMonitor(HostClock()), lambda _: True)


@pytest.fixture
def server(session: zenoh.Session, service: RecalibrationService, tmp_path: Path) -> RpcServer:
    """Takes calls, and its thread does not run yet."""
    security_log = SecurityLog(tmp_path / "security.jsonl")
    server = RpcServer(
        KEY,
        RequestDispatcher(KEY, refuse_all("boot"), {}, security_log, lambda: 0),
        service,
        SignInWatch(security_log, FaultRegister(), tmp_path / "page-pin", lambda: 0),
        MessageSigner(lambda: None, "0" * 12, lambda: 0),
        prepare=lambda: None,
    )
    server.attach(session)
    return server


def flood(session: zenoh.Session, server: RpcServer) -> None:
    for _ in range(INBOX):
        session.put(f"{KEY}/load", b"5")
    wait_until(lambda: len(server.inbox) + server.inbox.dropped == INBOX, "the last signal")


def test_refused_load_signals_that_find_the_inbox_full_are_counted(session: zenoh.Session, server: RpcServer) -> None:
    flood(session, server)
    assert server.inbox.dropped == RESERVED_FOR_ANSWERS


def test_a_load_is_noted_though_the_inbox_is_full(
    session: zenoh.Session, server: RpcServer, service: RecalibrationService, recalibration: Recalibration
) -> None:
    flood(session, server)
    session.put(f"{KEY}/load", b'{"loaded": true}')

    def is_refused() -> bool:
        service.tick()
        refusal = recalibration.interlock.recalibration_refusal(confirmed=True, now_ns=HostClock().now_ns())
        return "a load hangs" in str(refusal)

    wait_until(is_refused, "the load")
