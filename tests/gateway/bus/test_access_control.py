"""Access control of a gateway's session, tried by a hostile client over a real link."""

import json
import time
from collections.abc import Callable, Iterator

import pytest
import zenoh

from gateway.bus.session import gateway_settings, open_session
from gateway.configuration.bus_section import BusSection
from tests.ports import unused_port
from tests.waiting import wait_until

KEY = "plumbline/v1/yard/crane-1/hook-1"
OTHER = "plumbline/v1/yard/crane-2/hook-1"
ANSWER_S = 1.0


class Bus:
    """A gateway's session with an alert, a status and a load signal; an honest viewer; and a hostile peer."""

    def __init__(self, **settings: object) -> None:
        endpoint = f"tcp/127.0.0.1:{unused_port()}"
        section = BusSection.model_validate({"listen": [endpoint], **settings})
        self.gateway = zenoh.open(gateway_settings(section, KEY))
        self.alert = self.gateway.declare_publisher(f"{KEY}/alert")
        self.gateway.declare_queryable(f"{KEY}/rpc/status", _answer_status)
        self.alive = self.gateway.liveliness().declare_token(f"{KEY}/alive")
        self.loads: list[int] = []
        self.gateway.declare_subscriber(f"{KEY}/load", lambda sample: self.loads.append(len(sample.payload)))
        self.viewer = open_session("client", [endpoint], [])
        self.hostile = open_session("client", [endpoint], [])
        self.seen: list[tuple[str, bytes]] = []
        self.viewer.declare_subscriber("plumbline/v1/**", self._see)

    def _see(self, sample: zenoh.Sample) -> None:
        self.seen.append((str(sample.key_expr), sample.payload.to_bytes()[:20]))

    def after_true_alert(self) -> list[tuple[str, bytes]]:
        """What the viewer has seen once a later message of the gateway has arrived."""
        marker = f"true {time.monotonic_ns()}".encode()
        wait_until(lambda: self.alert.put(marker) or (f"{KEY}/alert", marker[:20]) in self.seen, "a true alert")
        return [entry for entry in self.seen if not entry[1].startswith(b"true")]

    def statuses(self) -> list[bytes]:
        replies = self.viewer.get(
            f"{KEY}/rpc/status",
            timeout=ANSWER_S,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    def close(self) -> None:
        for session in (self.viewer, self.hostile, self.gateway):
            session.close()


def _answer_status(query: zenoh.Query) -> None:
    with query:
        query.reply(f"{KEY}/rpc/status", b"true")


@pytest.fixture
def open_bus() -> Iterator[Callable[..., Bus]]:
    opened: list[Bus] = []

    def open_one(**settings: object) -> Bus:
        opened.append(Bus(**settings))
        return opened[-1]

    yield open_one
    for bus in opened:
        bus.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    "forged_key",
    [
        f"{KEY}/alert",
        f"{KEY}/health",
        "plumbline/v1/yard/crane-1/*/alert",
        "plumbline/v1/yard/**",
        "plumbline/v1/*/*/*/alert",
        "**",
        OTHER + "/alert",
    ],
)
def test_forged_publications_reach_nobody(open_bus: Callable[..., Bus], forged_key: str) -> None:
    bus = open_bus()
    bus.after_true_alert()
    for _ in range(5):
        bus.hostile.put(forged_key, b"forged")
    bus.hostile.put(f"{KEY}/load", b"{}")
    wait_until(lambda: bus.loads, "the load signal behind the forged messages on the same link")
    assert [entry for entry in bus.after_true_alert() if entry[0] != f"{KEY}/load"] == []


def test_forged_answers_and_liveliness_reach_nobody(open_bus: Callable[..., Bus]) -> None:
    bus = open_bus()

    def forge(query: zenoh.Query) -> None:
        with query:
            query.reply(f"{KEY}/rpc/status", b"forged")

    for key_expr in (f"{KEY}/rpc/status", "plumbline/v1/**", "**"):
        bus.hostile.declare_queryable(key_expr, forge)
    tokens = [bus.hostile.liveliness().declare_token(f"{key}/alive") for key in (OTHER, KEY)]
    assert set(bus.statuses()) == {b"true"}
    alive = [str(reply.ok.key_expr) for reply in bus.viewer.liveliness().get("plumbline/v1/**") if reply.ok]
    assert alive == [f"{KEY}/alive"]
    for token in tokens:
        token.undeclare()
    assert [str(reply.ok.key_expr) for reply in bus.viewer.liveliness().get(f"{KEY}/alive") if reply.ok] == alive


def test_a_message_beyond_the_limit_is_dropped_and_the_link_stays(open_bus: Callable[..., Bus]) -> None:
    bus = open_bus()
    for payload in (b"x" * 10_000_000, b"{}"):  # neither may be dropped by the sender
        bus.hostile.put(f"{KEY}/load", payload, congestion_control=zenoh.CongestionControl.BLOCK)
    wait_until(lambda: bus.loads, "a load signal")
    assert bus.loads == [2]


def test_other_gateways_publish_through_this_one_where_that_is_configured(open_bus: Callable[..., Bus]) -> None:
    bus = open_bus(forward=["plumbline/v1/yard/crane-2"])
    bus.after_true_alert()
    bus.hostile.put(f"{OTHER}/alert", json.dumps({"from": "crane-2"}))
    bus.hostile.put(f"{KEY}/alert", b"forged")
    wait_until(lambda: any(key == f"{OTHER}/alert" for key, _ in bus.seen), "the other gateway's alert")
    assert {key for key, _ in bus.after_true_alert()} == {f"{OTHER}/alert"}
