"""Who has no key of the gateway shows nobody a calm card, ends no alarm, and answers no command: with real processes."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

from gateway.bus.alert_receiver import AlertReceiver
from gateway.gateway_state import GatewayState
from gateway.messages import Alert
from tests.system.bus_router import BusRouter
from tests.system.conftest import ROOT, JoinBus, Plumbline, RunningGateway, StartGateway
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

KEY = "plumbline/v1/yard/c1/hook-1"
SITE = '[gateway]\nsite = "yard"\ncrane = "c1"\n'
TRIP = f"{SITE}[alerts]\nwarn_deg = 0.2\ntrip_deg = 0.3\nclear_deg = 0.1\n"
CALM = f"{SITE}[alerts]\nwarn_deg = 80\ntrip_deg = 85\nclear_deg = 70\nlean_trip_deg = 80\n"
LOOKS = 2
RANDOM_BYTES = 16
REPLAY_S = 3.0
NOT_THERE = {"state": "none", "authenticated": False}


@contextmanager
def forger(what: str, endpoint: str, *arguments: str | Path) -> Iterator[None]:
    program = [sys.executable, "-m", "tests.system.forger", what, endpoint, *map(str, arguments)]
    process = subprocess.Popen(program, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The receivers are those of a user who has run no gateway: keys are known by their pins alone."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "receiver"))


class Consumer:
    """A program that follows the alerts."""

    def __init__(self, router: BusRouter) -> None:
        self.receiver = AlertReceiver(router.endpoint, KEY)
        self.changes: list[Alert] = []
        self.states: list[GatewayState] = []

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Follow until a condition is true."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, f"waited in vain for {what}; got {self.states}"
            for event in self.receiver.poll(0.1):
                self.changes += [] if event.change is None else [event.change]
                self.states += [] if event.state is None else [event.state]

    def until_state(self, state: GatewayState) -> None:
        self.until(lambda: self.states[-1:] == [state], state)


class Site:
    """A router that checks nothing, one gateway, and its receivers."""

    def __init__(self, start_gateway: StartGateway, plumbline: Plumbline, folder: Path) -> None:
        self.router = BusRouter()
        self._start, self._folder = start_gateway, folder
        self.run = plumbline
        self.link = "--connect", self.router.endpoint
        self._consumers: list[Consumer] = []

    def start(self, toml: str, program: Sequence[str] = ("gateway",)) -> RunningGateway:
        """Start the gateway, as another user than that of the receivers."""
        bus = {"PLUMBLINE_BUS__CONNECT": json.dumps([self.router.endpoint])}
        return self._start(toml, program=program, environment={**bus, "XDG_STATE_HOME": str(self._folder / "gateway")})

    def card(self) -> Any:
        """The gateway in `fleet status`, as another program reads it."""
        shown = json.loads(self.run("fleet", "status", *self.link, "--json", "-").stdout)["gateways"]
        return next(iter(shown), NOT_THERE)

    def card_becomes(self, state: str) -> None:
        wait_until(lambda: self.card()["state"] == state, state)

    def pin(self) -> None:
        """Meet the gateway for the first time."""
        self.consume().until_state(GatewayState.FINE)

    def consume(self) -> Consumer:
        self._consumers.append(Consumer(self.router))
        return self._consumers[-1]

    def close(self) -> None:
        for each in self._consumers:
            each.receiver.close()
        self.router.kill()


@pytest.fixture
def site(start_gateway: StartGateway, plumbline: Plumbline, tmp_path: Path) -> Iterator[Site]:
    site = Site(start_gateway, plumbline, tmp_path)
    yield site
    site.close()


def test_a_forged_calm_is_shown_to_nobody_and_ends_no_alarm(site: Site, join_bus: JoinBus) -> None:
    site.start(TRIP)
    join_bus(site.router.endpoint).wait_for("alert", lambda alert: alert["level"] == "trip")
    site.pin()
    consumer = site.consume()
    consumer.until_state(GatewayState.FINE)
    with forger("calm", site.router.endpoint, KEY):
        consumer.until_state(GatewayState.NOT_AUTHENTICATED)
        refused = consumer.receiver.refused
        looks = [site.card() for _ in range(LOOKS)]
        consumer.until(lambda: consumer.receiver.refused > refused + 50, "forged messages")
        watched = site.run("remote", "watch", *site.link, "--topics", "condition", "--count", "20")
    assert {(look["state"], look["level"]) for look in looks} == {("TRIP", "trip")}
    assert not all(look["authenticated"] for look in looks)
    assert {"not_authenticated" in json.loads(line) for line in watched.stdout.splitlines()} == {True, False}
    assert [change for change in consumer.changes if change.event == "cleared"] == []
    consumer.until_state(GatewayState.FINE)  # the forger has ended


def test_what_was_recorded_before_is_not_shown_as_the_present(site: Site, join_bus: JoinBus, tmp_path: Path) -> None:
    gateway = site.start(CALM)
    site.pin()
    recorded = record(site.router.endpoint, tmp_path / "recorded.jsonl", join_bus)
    consumer = site.consume()
    consumer.until_state(GatewayState.FINE)
    gateway.stop()
    consumer.until_state(GatewayState.GATEWAY_GONE)
    end_s = time.monotonic() + REPLAY_S
    with forger("replay", site.router.endpoint, recorded):  # to one who was there, and to one who was not
        late = site.consume()
        late.until_state(GatewayState.NOT_AUTHENTICATED)
        assert not site.card()["authenticated"]
        before = len(consumer.states)
        consumer.until(lambda: time.monotonic() > end_s, "some replays")
        assert GatewayState.FINE not in [*consumer.states[before:], *late.states]
        site.start(TRIP)
        site.card_becomes("TRIP")  # beside messages of an earlier boot
        late.until_state(GatewayState.FINE)
    for each in (consumer, late):
        assert [change for change in each.changes if change.event == "cleared"] == []


def record(endpoint: str, file: Path, join_bus: JoinBus) -> Path:
    """Record signed messages of each topic until the alert has come three times."""
    peer = join_bus(endpoint)
    lines: list[dict[str, str]] = []

    def keep(sample: zenoh.Sample) -> None:
        if sample.attachment is not None:
            payload, signature = sample.payload.to_bytes(), sample.attachment.to_bytes()
            lines.append({"key": str(sample.key_expr), "payload": payload.hex(), "attachment": signature.hex()})

    subscriber = peer.session.declare_subscriber(f"{KEY}/*", keep)
    wait_until(lambda: sum(line["key"].endswith("/alert") for line in list(lines)) >= 3, "alerts")
    wait_until(lambda: any(line["key"].endswith("/health") for line in list(lines)), "a health message")
    subscriber.undeclare()
    file.write_text("".join(json.dumps(line) + "\n" for line in lines if not line["key"].endswith("/samples")))
    return file


def test_an_answer_of_somebody_else_is_not_believed_and_nothing_is_signed_for_him(site: Site, tmp_path: Path) -> None:
    gateway = site.start(CALM)
    site.pin()
    asked = tmp_path / "asked.jsonl"
    mark = "remote", "mark", "x", "--by", "ann", *site.link, "--credentials", gateway.data_dir
    with forger("answer", site.router.endpoint, KEY, asked):
        beside = site.run(*mark)
        assert (beside.returncode, beside.stdout) == (0, "mark: marked: x\n")  # the true answer is found
        gateway.process.send_signal(signal.SIGSTOP)
        asked.unlink()
        alone = site.run(*mark)
        status = site.run("remote", "status", *site.link)
        gateway.process.send_signal(signal.SIGCONT)
    assert (alone.returncode, alone.stdout) == (1, "")
    assert "NOT AUTHENTICATED" in alone.stderr
    assert "forged" not in alone.stdout + alone.stderr
    assert "OK" not in status.stdout.split("\n")[0]
    questions = [json.loads(line) for line in asked.read_text().splitlines()]
    assert "mark" not in {each["verb"] for each in questions}
    assert {len(bytes.fromhex(each["attachment"])) for each in questions} == {RANDOM_BYTES}  # no credential


def test_another_key_is_not_authenticated_until_a_person_accepts_it(site: Site) -> None:
    gateway = site.start(CALM)
    site.pin()
    gateway.stop()
    for file in gateway.data_dir.glob("signing-key.pem*"):
        file.unlink()
    site.start(CALM)
    site.card_becomes("NOT AUTHENTICATED")
    (reason,) = [each for each in site.card()["reasons"] if "--accept-key" in each]
    accept = reason.partition("plumbline remote status ")[2].split()
    assert accept[:2] == ["--gateway", KEY]
    nobodys = site.run("remote", "status", *site.link, "--gateway", KEY, "--accept-key", "0000-0000-0000-0000")
    assert (nobodys.returncode, nobodys.stdout) == (2, "")
    assert "none that answers has this fingerprint" in nobodys.stderr
    assert site.run("remote", "status", *site.link, *accept).stderr == ""
    wait_until(lambda: site.card()["authenticated"], "the accepted key")


def test_a_gateway_that_makes_its_key_on_a_slow_disk_sends_nothing_before(site: Site, tmp_path: Path) -> None:
    slow = tmp_path / "stalled"
    slow.write_text("slow")
    consumer = site.consume()
    site.start(CALM, program=("tests.system.stalling_disk", str(slow)))
    consumer.until_state(GatewayState.FINE)
    assert GatewayState.NOT_AUTHENTICATED not in consumer.states


def test_a_gateway_without_a_key_is_never_shown_as_authenticated(site: Site, tmp_path: Path) -> None:
    (tmp_path / "no-key.pem").mkdir()  # a key that cannot be read or made
    gateway = site.start(f"{CALM}[recorder]\nkey = '{tmp_path / 'no-key.pem'}'\n")
    site.card_becomes("NOT AUTHENTICATED")
    assert site.card()["swing"] is None
    marked = site.run("remote", "mark", "x", "--by", "ann", *site.link, "--credentials", gateway.data_dir)
    assert (marked.returncode, marked.stdout) == (0, "mark: marked: x\n")
    assert "NOT AUTHENTICATED: it is not signed" in marked.stderr
    consumer = site.consume()
    consumer.until_state(GatewayState.NOT_AUTHENTICATED)
