"""Invalid requests for a recalibration are refused, and a damaged store is no calibration."""

import json
from pathlib import Path

import pytest

from tests.system.bus_query import KEY, query, query_signed
from tests.system.conftest import JoinBus, StartGateway

pytestmark = pytest.mark.slow


def test_invalid_requests_are_refused_with_a_reason(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    good = json.dumps({"id": "request-1", "by": "eve", "housing_off_rope": True}).encode()
    for payload, said in (
        (b"", "id"),
        (b"\xff\xfe", "Invalid JSON"),
        (b"[]", "object"),
        (b'{"id": "request-1"}', "by"),
        (good + b" " * 20_000, "is the most"),
    ):
        ((accepted, content),) = query_signed(peer.session, "recalibrate", payload, gateway.data_dir)
        assert not accepted
        assert said in content["reason"], content
    assert query(peer.session, "recalibrate", good, key="plumbline/v1/*/*/*") == []  # a request goes to one gateway
    peer.session.put(f"{KEY}/load", b'{"loaded": true}')
    ((accepted, content),) = query_signed(peer.session, "recalibrate", good, gateway.data_dir)
    assert not accepted
    assert "a load hangs" in content["reason"]
    ((_, status),) = query(peer.session, "status")
    assert status["calibration"]["session"]["phase"] == "idle"
    assert gateway.process.poll() is None


def test_a_damaged_store_leaves_the_device_uncalibrated(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    folder = tmp_path / "data" / "calibration" / "simulated-1"
    folder.mkdir(parents=True)
    (folder / "in_force.json").write_text('{"format": 1')
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    ((_, status),) = query(peer.session, "status")
    message = status["calibration"]
    assert message["status"] == "uncalibrated"
    assert message["calibration_id"] is None
    assert "in_force.json" in message["text"]
