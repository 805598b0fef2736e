"""A gateway whose surroundings are broken when it starts samples and alerts nevertheless, publishes the fault, and recovers."""

import json
import os
import signal
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
import zenoh

from gateway.configuration.model import Configuration
from gateway.daemon.doctor.checks import check_signing_key
from gateway.messages import Health
from gateway.pki.signing_key import read_public_key
from gateway.recording.reading.recording_file import open_recording
from tests.ports import unused_port
from tests.system.conftest import BusPeer, JoinBus, Plumbline, RunningGateway, StartGateway, listening_on
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

ALERTS = "alert"


def wait_healed(peer: BusPeer, ill: Any) -> Any:
    """The first health without a fault after one that stated some: those before it may not know of them yet."""
    return peer.wait_for(
        "health", lambda message: message["sequence"] > ill["sequence"] and not message["standing_faults"]
    )


def test_an_occupied_port_of_the_page_is_taken_as_soon_as_it_is_free(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    port = unused_port()
    with listening_on(port):
        gateway = start_gateway(page=True, environment={"PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{port}"})
        peer = join_bus(gateway.endpoint)
        said = peer.wait_for("health", lambda message: "page" in message["standing_faults"])
        assert f"127.0.0.1:{port} cannot be used" in said["standing_faults"]["page"]
        peer.wait_for(ALERTS)
    healed = wait_healed(peer, said)
    assert healed["faults"]["page_failures"] == 1
    with urlopen(f"http://127.0.0.1:{port}/", timeout=PATIENCE_S) as answer:
        assert b"<html" in answer.read()
    gateway.stop()


def test_an_occupied_port_of_the_bus_is_taken_as_soon_as_it_is_free(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    port = unused_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    with listening_on(port):
        gateway = start_gateway(environment={"PLUMBLINE_BUS__LISTEN": json.dumps([endpoint])})
        assert endpoint in present(gateway.process.stderr).readline()
        wait_until(lambda: gateway.recordings, "a recording")
    peer = join_bus(endpoint)
    healed = peer.wait_for("health", lambda message: not message["standing_faults"])
    assert healed["faults"]["bus_failures"] == 1
    assert healed["samples"] > 0
    gateway.stop()


def test_a_client_whose_router_is_down_samples_at_once_and_obeys_sigterm(start_gateway: StartGateway) -> None:
    gateway = client_without_router(start_gateway, unused_port())
    wait_until(lambda: gateway.recordings, "a recording")
    assert gateway.stop()[0] == 0


def test_a_client_finds_a_router_that_comes_later(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    port = unused_port()
    gateway = client_without_router(start_gateway, port)
    wait_until(lambda: gateway.recordings, "a recording")
    settings = zenoh.Config()
    for key, value in (("mode", "router"), ("listen/endpoints", [f"tcp/127.0.0.1:{port}"])):
        settings.insert_json5(key, json.dumps(value))
    settings.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(settings):
        peer = join_bus(f"tcp/127.0.0.1:{port}")
        peer.wait_for(ALERTS)
        peer.wait_for("health", lambda message: not message["standing_faults"])
        gateway.stop(signal.SIGINT)


def client_without_router(start_gateway: StartGateway, port: int) -> RunningGateway:
    environment = {"PLUMBLINE_BUS__MODE": "client", "PLUMBLINE_BUS__CONNECT": f'["tcp/127.0.0.1:{port}"]'}
    return start_gateway(environment={**environment, "PLUMBLINE_BUS__LISTEN": "[]"})


def test_a_data_folder_that_cannot_be_made_is_recorded_to_as_soon_as_it_can(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    blocking = tmp_path / "data"
    blocking.write_text("a file where the folder should be")
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    said = peer.wait_for("health", lambda message: message["recording_error"])
    assert "data: cannot be written" in said["recording_error"]
    peer.wait_for(ALERTS)
    blocking.unlink()
    assert wait_healed(peer, said)["recording"] is not None
    assert gateway.stop()[0] == 3  # the samples before are not in the recording


def test_an_outbox_that_cannot_be_made_is_a_fault_until_it_can(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    blocking = tmp_path / "data" / "alerts"
    blocking.parent.mkdir()
    blocking.write_text("a file where the folder should be")
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    first = peer.wait_for("health", lambda message: "outbox" in message["standing_faults"])
    peer.wait_for(
        "health", lambda message: message["sequence"] > first["sequence"] + 8
    )  # beyond a retry of the writing
    said = [message for message in peer.messages("health") if message["sequence"] >= first["sequence"]]
    assert all("alerts are sent without being stored" in each["standing_faults"]["outbox"] for each in said)
    assert {each["faults"]["outbox_failures"] for each in said} == {1}
    blocking.unlink()
    wait_healed(peer, said[-1])
    gateway.stop()


COLLECTING = {
    "id": "a",
    "phase": "collecting",
    "method": "six-Position",
    "by": "ann",
    "device_id": "simulated-1",
    "parent": None,
    "begun_ns": 4_000_000_000_000_000_000,
    "touched_ns": 1_000_000_000_000_000_000,
}


def test_a_session_of_an_unknown_method_does_not_stop_the_monitoring(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    path = tmp_path / "data" / "calibration" / "session.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"format": 1, "answers": [], "session": COLLECTING}))
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for(ALERTS)
    peer.wait_for("health", lambda message: message["samples"] > 0)
    code, err = gateway.stop()
    assert code == 0
    assert "Traceback" not in err
    assert "ERROR" in err or "WARNING" in err


def test_a_gateway_whose_signing_key_is_gone_makes_another_and_says_so(start_gateway: StartGateway) -> None:
    first = start_gateway(arguments=["--duration", "2"])
    assert first.wait()[0] == 0
    folder = first.data_dir
    before = (folder / "signing-key.pem.pub").read_text()
    (folder / "signing-key.pem").unlink()
    (found,) = check_signing_key(Configuration.model_validate({"gateway": {"data_dir": folder}}))
    assert (found.grade, "signing-key.pem: is missing, and the recordings are signed with" in found.text) == (
        "bad",
        True,
    )
    code, _, err = start_gateway(arguments=["--duration", "2"]).wait()
    assert code == 0
    (line,) = [line for line in err.splitlines() if "signing-key.pem" in line]
    assert "ERROR plumbline.fault: " in line
    assert "was missing, and a new key was made" in line
    assert (folder / "signing-key.pem.pub").read_text() != before
    recorded = open_recording(first.recordings[-1])
    health = [recorded.decode(message) for message in recorded.messages() if message.topic == "/health"]
    assert any("new key" in each.standing_faults.get("signing", "") for each in health if isinstance(each, Health))
    assert "signing-key.pem" not in start_gateway(arguments=["--duration", "2"]).wait()[2]


def test_a_gateway_whose_chain_is_damaged_records_signs_and_says_what_it_lost(
    start_gateway: StartGateway, plumbline: Plumbline
) -> None:
    first = start_gateway(arguments=["--duration", "2"])
    assert first.wait()[0] == 0
    path = first.data_dir / "chain.json"
    content = bytearray(path.read_bytes())
    content[content.index(b'"final_sha256":"') + 20] ^= 0x80
    path.write_bytes(content)
    code, out, err = start_gateway(arguments=["--duration", "2"]).wait()
    assert code == 0
    assert "signed" in out
    (line,) = [line for line in err.splitlines() if "chain.json" in line]
    assert "ERROR plumbline.fault: " in line
    assert "is damaged; it is kept as chain.json.damaged-1; by the statements in the recordings" in line
    assert "numbers go on with 2" in line
    assert (first.data_dir / "chain.json.damaged-1").read_bytes() == content
    _, newest = first.recordings
    recorded = [message for message in open_recording(newest).messages() if message.topic == "/health"]
    health = [open_recording(newest).decode(message) for message in recorded]
    assert any("chain.json" in each.standing_faults.get("chain", "") for each in health if isinstance(each, Health))
    key = read_public_key(str(first.data_dir / "signing-key.pem.pub"))
    verified = plumbline("record", "verify", str(first.data_dir), "--key", key)
    assert verified.returncode == 0, verified.stdout
    assert "before segment 2 the gateway had lost chain.json" in verified.stdout
    assert "chain.json" not in start_gateway(arguments=["--duration", "2"]).wait()[2]


def test_a_reader_of_the_log_that_stalls_costs_lines_and_nothing_else(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    unread, full = os.pipe()
    os.set_blocking(full, False)
    with suppress(BlockingIOError):
        while os.write(full, b" " * 4096):
            pass
    os.set_blocking(full, True)
    gateway = start_gateway(stderr=full, stdout=full)
    peer = join_bus(gateway.endpoint)
    peer.wait_for(ALERTS)
    assert peer.wait_for("health", lambda message: message["recording"])["standing_faults"] == {}
    assert gateway.stop()[0] == 0
    os.close(unread)
    os.close(full)


def test_an_unusable_endpoint_is_refused_in_one_line(start_gateway: StartGateway) -> None:
    code, _, err = start_gateway(environment={"PLUMBLINE_BUS__LISTEN": '["nowhere"]'}).wait()
    assert code == 2
    assert "an endpoint has the form" in err
    assert len(err.splitlines()) == 1


def test_the_ports_are_released_by_a_refused_start(start_gateway: StartGateway, tmp_path: Path) -> None:
    gateway = start_gateway("[device]\nrange_g = 1e-300\n")
    code, _, err = gateway.wait()
    assert code == 2
    assert "device.range_g" in err
    assert len(err.splitlines()) == 1
    with socket.create_server(("127.0.0.1", gateway.bus_port)):
        pass
