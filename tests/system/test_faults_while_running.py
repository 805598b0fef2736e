"""A gateway whose surroundings break while it runs: alerts go on, the fault is published, and SIGTERM is obeyed."""

import json
import os
import signal
import socket
import time
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from devices.host_clock import HostClock
from gateway.calibration.record import CalibrationRecord, content_hash
from gateway.calibration.store import CalibrationStore
from gateway.configuration.loading import validate
from gateway.daemon.sampling.device_factory import make_device
from tests.ports import unused_port
from tests.system.bus_query import query_signed
from tests.system.conftest import BusPeer, JoinBus, RunningGateway, StartGateway
from tests.values import present
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


def alerts_go_on(peer: BusPeer) -> None:
    """Wait for an alert that is newer than now."""
    now_ns = peer.messages("alert")[-1]["time_ns"]
    peer.wait_for("alert", lambda message: message["time_ns"] > now_ns)


def ends_in_time(gateway: RunningGateway) -> int:
    code, err = gateway.stop()
    assert "Traceback" not in err
    return code


def put_in_force(data_dir: Path, *names: str) -> None:
    """Store copies of the simulated device's factory record, and put one after the other in force."""
    info = make_device(validate({}, "test"), HostClock()).open()
    store = CalibrationStore(data_dir, info.device_id)
    for name in names:
        content = present(info.factory_calibration) | {"id": name}
        content["sha256"] = content_hash(content)
        store.add(CalibrationRecord.model_validate(content))
        store.put_in_force(name, by="ann", reason="", request=name, time_utc="2026-01-03T00:00:00Z")


def test_a_disk_that_takes_nothing_stops_neither_alerts_nor_the_end(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    gate = tmp_path / "stalled"
    gateway = start_gateway(program=("tests.system.stalling_disk", str(gate)))
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["recording"])
    peer.wait_for("alert")
    gate.touch()
    samples = peer.wait_for("health")["samples"]
    for _ in range(4):
        alerts_go_on(peer)
    now = peer.wait_for("health", lambda message: message["samples"] > samples + 300)
    assert now["dropped"]["blocks"] == 0
    ends_in_time(gateway)


def test_a_disk_that_takes_nothing_at_start_delays_neither_samples_nor_the_end(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    gate = tmp_path / "stalled"
    gateway = start_gateway(program=("tests.system.stalling_disk", str(gate)))
    gate.touch()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("alert")
    ends_in_time(gateway)


def test_a_stored_record_that_cannot_be_read_delays_neither_alerts_nor_the_recording(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    put_in_force(tmp_path / "data", "older", "newer")
    gate = tmp_path / "stalled"
    gate.write_text("older.json")
    gateway = start_gateway(program=("tests.system.stalling_disk", str(gate)))
    peer = join_bus(gateway.endpoint)
    assert peer.wait_for("alert")["calibration_id"] == "newer"
    alerts_go_on(peer)
    peer.wait_for("health", lambda message: message["recording"])
    gate.unlink()
    wait_until(lambda: b"calibration-newer.html" in gateway.recordings[0].read_bytes(), "the certificate")
    assert ends_in_time(gateway) == 0
    with gateway.recordings[0].open("rb") as file:
        assert "calibration-newer.html" in {each.name for each in make_reader(file).iter_attachments()}


def roll_back(peer: BusPeer, gateway: RunningGateway, number: int) -> tuple[bool, Any]:
    payload = json.dumps({"id": f"request-{number}", "by": "ann", "to": "older"}).encode()
    ((accepted, content),) = query_signed(peer.session, "rollback", payload, gateway.data_dir)
    return accepted, content


def test_a_disk_that_is_slow_refuses_no_request(start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path) -> None:
    put_in_force(tmp_path / "data", "older", "newer")
    gate = tmp_path / "stalled"
    gateway = start_gateway(program=("tests.system.stalling_disk", str(gate)))
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["recording"])
    gate.write_text("slow")
    accepted, content = roll_back(peer, gateway, 1)
    assert accepted, content
    peer.wait_for("calibration", lambda message: message["calibration_id"] == "older")
    gate.unlink()
    ends_in_time(gateway)


@pytest.mark.parametrize("file", ["in_force.json", "older.json"])
def test_a_request_for_what_the_disk_does_not_give_is_refused_and_delays_no_alert(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path, file: str
) -> None:
    put_in_force(tmp_path / "data", "older", "newer")
    gate = tmp_path / "stalled"
    gateway = start_gateway(program=("tests.system.stalling_disk", str(gate)))
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["recording"])
    peer.wait_for("alert")

    gate.write_text(file)
    accepted, content = roll_back(peer, gateway, 1)
    assert (accepted, content["reason"]) == (False, "could not be executed: the disk does not answer")
    alerts_go_on(peer)
    gate.unlink()
    numbers = count(2)
    wait_until(lambda: roll_back(peer, gateway, next(numbers))[0], "the disk")
    peer.wait_for("calibration", lambda message: message["calibration_id"] == "older")
    ends_in_time(gateway)


def test_a_recording_that_was_deleted_while_it_was_written_is_followed_by_another(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    first = peer.wait_for("health", lambda message: message["recording"])["recording"]
    Path(first).unlink()
    second = peer.wait_for("health", lambda message: message["recording"] not in (None, first))
    assert Path(second["recording"]).exists()
    assert second["faults"]["segments_vanished"] == 1
    assert second["recording_error"] is None
    gateway.stop()


def test_a_service_waits_for_its_sensor_and_says_so(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway('[device]\nkind = "adxl355"\nbus = 77\n', arguments=("--service",))
    peer = join_bus(gateway.endpoint)
    said = peer.wait_for("health", lambda message: "device" in message["standing_faults"])
    assert said["state"] == "recovering"
    assert said["device_id"] is None
    assert said["device_kind"] == "adxl355"
    assert "/dev/i2c-77" in said["standing_faults"]["device"]
    ends_in_time(gateway)


@pytest.mark.parametrize("after_s", [0.0, 0.5, 1.0, 2.0])
def test_a_signal_at_any_time_of_the_start_ends_it(start_gateway: StartGateway, after_s: float) -> None:
    port = unused_port()
    environment = {"PLUMBLINE_BUS__MODE": "client", "PLUMBLINE_BUS__CONNECT": f'["tcp/127.0.0.1:{port}"]'}
    with socket.create_server(("127.0.0.1", port)):  # accepts, and never answers
        environment["PLUMBLINE_BUS__LISTEN"] = "[]"
        gateway = start_gateway(page=True, environment=environment, prefix=("env",))  # no fork of what has started
        time.sleep(after_s)
        code, _ = gateway.stop()
    assert code in (0, 3, -signal.SIGTERM)  # the last: before Python could take the signal


def test_a_page_that_stands_still_delays_the_end_by_little(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway(page=True)
    join_bus(gateway.endpoint).wait_for("health")
    children = Path(f"/proc/{gateway.process.pid}/task/{gateway.process.pid}/children")
    wait_until(children.read_text, "the page")
    (page,) = children.read_text().split()
    os.kill(int(page), signal.SIGSTOP)
    ends_in_time(gateway)
    wait_until(lambda: not Path(f"/proc/{page}").exists(), "the page to end")
