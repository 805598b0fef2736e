"""A hostile peer on loopback, without any credential, in a process of its own: it forges, floods, stalls and sends garbage."""

import json
import os
import shutil
import signal
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import zenoh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gateway.authorization.credential import Challenge
from gateway.bus.credentials import load_credentials
from gateway.topics import TOPICS
from gateway.verbs import VERBS
from tests.ports import unused_port
from tests.system.bus_query import KEY, query, sign
from tests.system.conftest import BusPeer, Hostile, JoinBus, Plumbline, RunningGateway, StartGateway, health
from tests.system.test_alert_delivery import CHATTERING
from tests.waiting import wait_until

pytestmark = pytest.mark.slow
ODR_HZ = 1000
TOML = f'[device]\nkind = "simulated"\nodr_hz = {ODR_HZ}\n'
TRIP = "[alerts]\nwarn_deg = 0.2\ntrip_deg = 0.3\nclear_deg = 0.1\n"


def resident_mb(gateway: RunningGateway) -> float:
    lines = Path(f"/proc/{gateway.process.pid}/status").read_text().splitlines()
    (line,) = [line for line in lines if line.startswith("VmRSS:")]
    return int(line.split()[1]) / 1024


def test_forged_messages_of_every_topic_reach_no_client(
    start_gateway: StartGateway, join_bus: JoinBus, hostile: Hostile
) -> None:
    gateway = start_gateway(TOML + TRIP)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("alert", lambda alert: alert["level"] == "trip")
    hostile(
        gateway.endpoint,
        f"""
while True:
    for topic in {[*TOPICS, "load/x", "*"]}:
        session.put("{KEY}/" + topic, json.dumps({{"level": "normal", "note": "by eve"}}))
    session.put("plumbline/v1/**", b"by eve")
    session.delete("{KEY}/alert")
    time.sleep(0.01)
""",
    )
    seen = len(peer.heard)
    wait_until(lambda: len(peer.heard) > seen + 200, "messages after the forged ones")
    assert not any(b"by eve" in payload for _, _, payload in list(peer.heard))
    assert {alert["level"] for alert in peer.messages("alert")[-5:]} == {"trip"}


def test_no_request_without_a_credential_changes_anything_and_each_is_counted(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    gateway = start_gateway(TOML)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    changing = [verb.name for verb in VERBS.values() if verb.role is not None]
    payload = json.dumps({"id": "request-1", "by": "ann", "housing_off_rope": True}).encode()
    for verb in changing:
        ((accepted, content),) = query(peer.session, verb, payload)
        assert (accepted, content["kind"]) == (False, "no_credential")
    assert health(peer)["refused"] == {"no_credential": len(changing)}
    assert not (gateway.data_dir / "calibration" / "audit.jsonl").exists()
    lines = (gateway.data_dir / "security.jsonl").read_text().splitlines()
    assert {json.loads(line)["key"] for line in lines} == {f"rpc/{verb}" for verb in changing}
    assert all(json.loads(line)["origin"].startswith("tcp/127.0.0.1:") for line in lines)

    # what is too large is refused as well
    ((accepted, content),) = query(peer.session, "cancel", b"{}", bytes(20_000))
    assert (accepted, content["kind"]) == (False, "malformed_credential")
    peer.session.put(f"{KEY}/load", bytes(20_000))
    refused = health(peer, least_refused=len(changing) + 2)["refused"]
    assert refused == {"no_credential": len(changing), "malformed_credential": 1, "invalid_signal": 1}

    # one that cannot be written is a fault
    security_log = gateway.data_dir / "security.jsonl"
    security_log.unlink()
    security_log.mkdir()
    query(
        peer.session, "acknowledge", b"{}", bytes(20_000)
    )  # of another kind than before, so that it is written at once
    assert health(peer)["faults"]["security_log_not_written"] == 1


def test_a_flood_of_requests_loses_no_sample_and_the_engineer_gets_through(
    start_gateway: StartGateway, join_bus: JoinBus, hostile: Hostile, plumbline: Plumbline
) -> None:
    gateway = start_gateway(TOML)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    before = health(peer)
    for _ in range(2):
        hostile(
            gateway.endpoint,
            f"""
while True:
    for verb in ("cancel", "fetch", "status"):
        session.get("{KEY}/rpc/" + verb, lambda reply: None, payload=b'{{"id": "request-1", "by": "eve"}}')
    time.sleep(0.0005)
""",
        )
    marked = plumbline(
        "remote", "mark", "still here", "--by", "ann", "--connect", gateway.endpoint, "--credentials", gateway.data_dir
    )
    assert marked.returncode == 0, marked.stderr
    after = health(peer, 5.0, least_refused=500)
    assert after["lost"] == before["lost"]
    assert after["dropped"]["blocks"] == before["dropped"]["blocks"]
    assert (gateway.data_dir / "security.jsonl").stat().st_size < 20_000


def test_large_messages_and_a_stalled_peer_cost_no_memory_and_no_alert(
    start_gateway: StartGateway, join_bus: JoinBus, hostile: Hostile
) -> None:
    gateway = start_gateway(TOML)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    before_mb = resident_mb(gateway)
    stalled = hostile(gateway.endpoint, 'subscriber = session.declare_subscriber("**", print)\ntime.sleep(3600)')
    os.kill(stalled.pid, signal.SIGSTOP)
    large = hostile(
        gateway.endpoint,
        f"""
for _ in range(3):
    session.put("{KEY}/load", bytes(100_000_000), congestion_control=zenoh.CongestionControl.BLOCK)
    for reply in session.get("{KEY}/rpc/cancel", payload=bytes(50_000_000), timeout=2.0):
        pass
print("sent", flush=True)
time.sleep(3600)
""",
    )
    assert large.stdout is not None
    assert large.stdout.readline() == "sent\n"
    alerts = len(peer.messages("alert"))
    wait_until(lambda: len(peer.messages("alert")) > alerts + 3, "heartbeats of the alerts")
    assert resident_mb(gateway) < before_mb + 50
    assert health(peer)["dropped"]["blocks"] == 0
    os.kill(stalled.pid, signal.SIGCONT)


def test_garbage_on_every_verb_and_signal_stops_nothing(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway(TOML)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    credentials = load_credentials(gateway.data_dir)
    deep = b"[" * 8000

    @settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(
        st.sampled_from(sorted(VERBS)),
        st.one_of(st.binary(max_size=400), st.just(deep), st.just(b'{"id": ' + deep), st.builds(_json, st.text())),
        st.booleans(),
    )
    def attack(verb: str, payload: bytes, signed: bool) -> None:
        attachment: bytes | None = payload
        if signed:
            ((accepted, challenge),) = query(peer.session, "challenge")
            if accepted:
                attachment = credentials.prove(f"{KEY}/rpc/{verb}", payload, Challenge.model_validate(challenge))
        query(peer.session, verb, payload, attachment)
        peer.session.put(f"{KEY}/load", payload)

    attack()
    assert gateway.process.poll() is None
    after = health(peer)
    assert after["lost"] == 0
    assert after["refused"]["invalid_signal"] > 0
    code, err = gateway.stop()
    assert (code, "Traceback" in err) == (0, False)


def _json(text: str) -> bytes:
    return json.dumps({"id": text, "by": text, "reason": text, "text": text, "loaded": text}).encode()


def test_a_second_gateway_with_the_same_key_is_noticed(tmp_path: Path) -> None:
    def is_noticed(message: Any) -> bool:
        return "identity" in message["standing_faults"]

    endpoint = f"tcp/127.0.0.1:{unused_port()}"
    config = zenoh.Config()
    for key, value in {"mode": "router", "listen/endpoints": [endpoint], "scouting/multicast/enabled": False}.items():
        config.insert_json5(key, json.dumps(value))
    gateways: list[RunningGateway] = []
    with zenoh.open(config):
        try:
            for name in ("one", "two"):
                (tmp_path / name).mkdir()
                if gateways:  # from a copy of the disk
                    signing_key = gateways[0].data_dir / "signing-key.pem"
                    wait_until(signing_key.exists, "the key of the first")
                    (tmp_path / name / "data").mkdir()
                    shutil.copy(signing_key, tmp_path / name / "data")
                connect = {"PLUMBLINE_BUS__CONNECT": json.dumps([endpoint])}
                gateways.append(RunningGateway(tmp_path / name, environment=connect))
            with closing(BusPeer(endpoint, f"{KEY}/health")) as peer:
                one = peer.wait_for("health", is_noticed)
                assert f"another gateway has the same key {KEY}" in one["standing_faults"]["identity"]
                # Each looks at its own time: the other one has nothing to report if the first is stopped before it looks.
                two = peer.wait_for(
                    "health", lambda message: is_noticed(message) and message["boot_id"] != one["boot_id"]
                )
                assert one["boot_id"] in two["standing_faults"]["identity"]
                gateways[0].stop()
                peer.wait_for(
                    "health", lambda message: message["faults"].get("identity_failures") and not is_noticed(message)
                )
        finally:
            for gateway in gateways:
                gateway.process.kill()
                gateway.process.communicate()


def test_a_kept_acknowledgement_silences_nothing_that_was_raised_after_it_was_signed(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    gateway = start_gateway(CHATTERING)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("alert", lambda alert: alert["event"] == "raised")

    def answer_to_kept(number: int) -> Any:
        """What a router gets that keeps an acknowledgement of everything until the next alarm."""
        payload = json.dumps({"id": f"request-{number}", "by": "ann"}).encode()
        kept = sign(peer.session, "acknowledge", payload, gateway.data_dir)
        known = [alert["incident"] for alert in peer.messages("alert")]
        later = peer.wait_for("alert", lambda alert: alert["event"] == "raised" and alert["incident"] not in known)
        ((_, content),) = query(peer.session, "acknowledge", payload, kept)
        return later["incident"], content

    for number in range(20):  # one that comes after 30 s is refused altogether
        incident, content = answer_to_kept(number)
        if content.get("kind") != "stale_credential":
            break
    assert incident not in json.dumps(content)
    alerts = [alert for alert in peer.messages("alert") if alert["incident"] == incident]
    assert alerts
    assert {alert["acknowledged_by"] for alert in alerts} == {None}
