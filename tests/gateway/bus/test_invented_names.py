"""Names of gateways that somebody invents keep no true one out, and cost no memory without end."""

import json
from collections.abc import Iterator

import pytest
import zenoh

from gateway.bus import router
from gateway.bus.alert_receiver import MOST_FOLLOWED, AlertReceiver
from gateway.bus.router import LatestStates
from gateway.messages import Alert
from gateway.topics import encode
from tests.ports import unused_port
from tests.waiting import wait_until

ALERT = encode(
    Alert(
        time_ns=0,
        clock="synchronised",
        sequence=0,
        level="normal",
        event="standing",
        validity="valid",
        active=[],
        text="",
    )
)


@pytest.fixture
def endpoint() -> str:
    return f"tcp/127.0.0.1:{unused_port()}"


@pytest.fixture
def bus(endpoint: str) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    for key, value in {"mode": "router", "listen/endpoints": [endpoint], "scouting/multicast/enabled": False}.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


@pytest.mark.slow
def test_a_gateway_that_comes_after_many_invented_ones_is_heard(bus: zenoh.Session, endpoint: str) -> None:
    with AlertReceiver(endpoint) as receiver:

        def heard(name: str) -> bool:
            list(receiver.poll(0.0))
            return name in receiver.present_states

        wait_until(
            lambda: bus.put("plumbline/v1/a/b/first/alert", ALERT) or heard("plumbline/v1/a/b/first"), "the link"
        )
        for number in range(MOST_FOLLOWED):
            bus.put(f"plumbline/v1/a/b/invented-{number}/alert", ALERT)
        true_one = "plumbline/v1/yard/c1/hook"  # says it again, as a gateway does: a full queue drops a message
        wait_until(lambda: bus.put(f"{true_one}/alert", ALERT) or heard(true_one), "the true one")
        assert len(receiver.present_states) == MOST_FOLLOWED


@pytest.mark.slow
def test_a_router_keeps_a_bounded_number_of_bytes(bus: zenoh.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(router, "MOST_BYTES", 1000)
    kept = LatestStates(bus)
    for number in range(20):
        bus.put(f"plumbline/v1/a/b/invented-{number}/alert", b"x" * 100)
    wait_until(lambda: len(kept) == 10, "ten messages")
    for _ in range(20):
        bus.put("plumbline/v1/a/b/invented-0/alert", b"y" * 100)  # in place of another one, which costs nothing
    bus.put("plumbline/v1/a/b/invented-0/alert", b"")
    bus.put("plumbline/v1/a/b/invented-20/alert", b"z" * 100)
    wait_until(lambda: len(kept) == 11, "the place that is free again")
    kept.close()
