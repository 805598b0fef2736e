"""Alerts of real gateways at real receivers: once and in order over restarts, acknowledged, with the state of the gateway."""

import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh

from gateway.bus.alert_receiver import AlertReceiver
from gateway.bus.alert_sequence import AlertEvent
from gateway.gateway_state import GatewayState
from gateway.outbox import AlertOutbox, Position
from tests.devices.serial.witmotion_wire import frame
from tests.system.bus_query import KEY
from tests.system.bus_router import BusRouter
from tests.system.conftest import ROOT, Plumbline, RunningGateway, StartGateway
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

CHATTERING = """
[rope]
length_m = 0.8
[housing]
position_m = 0.56
[device]
odr_hz = 100
block_samples = 10
[alerts]
warn_deg = 1.4
trip_deg = 1.4
clear_deg = 1.4
hold_s = 0
"""
"""A short rope and no hysteresis: a change of an alert every few seconds."""


@pytest.fixture
def router() -> Iterator[BusRouter]:
    router = BusRouter()
    yield router
    router.kill()


def connected(router: BusRouter) -> dict[str, str]:
    return {"PLUMBLINE_BUS__CONNECT": json.dumps([router.endpoint])}


class Follower:
    """A receiver with what it got."""

    def __init__(self, router: BusRouter, state_file: Path | None = None) -> None:
        self.receiver = AlertReceiver(router.endpoint, since=0, state_file=state_file)
        self.changes: list[tuple[str | None, int | None]] = []
        self.events: list[AlertEvent] = []

    @property
    def state(self) -> GatewayState | None:
        return self.receiver.present_states.get(KEY)

    def until(self, condition: Callable[[], object], what: str) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, f"waited in vain for {what}; got {self.changes}, {self.state}"
            for event in self.receiver.poll(0.05):
                self.events.append(event)
                if event.change is not None:
                    self.changes.append((event.change.boot_id, event.change.alert_number))

    def until_state(self, state: GatewayState) -> None:
        self.until(lambda: self.state is state, f"the state {state}")

    def until_count(self, count: int) -> None:
        self.until(lambda: len(self.changes) >= count, f"{count} changes")

    def reopen(self, router: BusRouter, state_file: Path) -> None:
        self.receiver.close()
        self.receiver = AlertReceiver(router.endpoint, since=0, state_file=state_file)


def stored(gateway: RunningGateway) -> list[tuple[str, int]]:
    page = AlertOutbox(gateway.data_dir / "alerts").page_after(Position(0), most_bytes=10**8)
    return [(change.boot_id, change.number) for change in page.changes]


def test_each_change_arrives_once_and_in_order_over_restarts_of_gateway_router_and_receiver(
    start_gateway: StartGateway, router: BusRouter, tmp_path: Path
) -> None:
    gateway = start_gateway(CHATTERING, environment=connected(router))
    state_file = tmp_path / "received.json"
    follower = Follower(router, state_file)
    follower.until_count(2)
    gateway.stop(signal.SIGKILL)
    gateway = start_gateway(CHATTERING, environment=connected(router))
    follower.until_count(4)
    router.kill()
    follower.until_state(GatewayState.LINK_GONE)
    router.start()
    follower.until_count(6)
    follower.receiver.close()
    wait_until(lambda: len(stored(gateway)) >= 2 + len(follower.changes), "changes that the receiver misses")
    follower.reopen(router, state_file)
    follower.until_count(8)
    gateway.stop()
    sent = stored(gateway)
    follower.receiver.close()
    assert follower.changes == sent[: len(follower.changes)]
    assert len({boot for boot, _ in follower.changes}) == 2
    assert all(event.missed is None for event in follower.events)


def test_a_consumer_tells_a_killed_and_a_hanging_gateway_from_a_link_that_is_gone(
    start_gateway: StartGateway, router: BusRouter
) -> None:
    gateway = start_gateway(CHATTERING, environment=connected(router))
    follower = Follower(router)
    follower.until_state(GatewayState.FINE)
    late = Follower(router)
    late.until(lambda: [event for event in late.events if event.state], "a state")
    assert [event.state for event in late.events if event.state] == [GatewayState.FINE]  # its first
    late.receiver.close()
    gateway.process.send_signal(signal.SIGSTOP)
    follower.until_state(GatewayState.GATEWAY_GONE)
    gateway.process.send_signal(signal.SIGCONT)
    follower.until_state(GatewayState.FINE)
    router.signal(signal.SIGSTOP)  # like a cable that is pulled: nothing comes, and nothing is closed
    follower.until_state(GatewayState.LINK_GONE)
    router.signal(signal.SIGCONT)
    follower.until_state(GatewayState.FINE)
    router.kill()
    follower.until_state(GatewayState.LINK_GONE)
    router.start()
    follower.until_state(GatewayState.FINE)
    gateway.stop(signal.SIGKILL)
    follower.until_state(GatewayState.GATEWAY_GONE)
    follower.receiver.close()


class Radio:
    """A sensor at rest on a pseudo-terminal; it can fall silent."""

    def __init__(self) -> None:
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.port = os.ttyname(self._theirs)
        self.talks = threading.Event()
        self.talks.set()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self) -> None:
        while not self._ending.wait(0.01):
            if self.talks.is_set():
                try:
                    os.write(self._ours, frame(0x51, 0, 0, 2048, 2500))
                except BlockingIOError:
                    continue

    def close(self) -> None:
        self._ending.set()
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)


def test_a_consumer_tells_a_sensor_that_is_gone_and_one_without_calibration(
    start_gateway: StartGateway, router: BusRouter
) -> None:
    radio = Radio()
    toml = f'[device]\nkind = "witmotion"\nport = "{radio.port}"\n[rope]\nlength_m = 6\n[housing]\nposition_m = 4\n'
    start_gateway(f"{toml}[alerts]\nstale_s = 3\n", environment=connected(router))
    follower = Follower(router)
    follower.until_state(GatewayState.UNCALIBRATED)
    radio.talks.clear()
    follower.until_state(GatewayState.SENSOR_GONE)
    assert GatewayState.GATEWAY_GONE not in [event.state for event in follower.events]
    radio.talks.set()
    follower.until_state(GatewayState.UNCALIBRATED)
    follower.receiver.close()
    radio.close()


def test_an_acknowledgement_of_what_was_before_a_kill_is_sent_recorded_and_replayed(
    start_gateway: StartGateway, router: BusRouter, plumbline: Plumbline
) -> None:
    gateway = start_gateway(CHATTERING, environment=connected(router))
    follower = Follower(router)
    follower.until(lambda: any(event.change and event.change.incident for event in follower.events), "an incident")
    incident = next(event.change.incident for event in follower.events if event.change and event.change.incident)
    gateway.stop(signal.SIGKILL)
    gateway = start_gateway(CHATTERING, environment=connected(router))
    follower.until(lambda: len({boot for boot, _ in follower.changes}) == 2, "a change after the start")
    connect, credentials = ("--connect", gateway.endpoint), ("--credentials", gateway.data_dir)
    nobody = plumbline("remote", "acknowledge", *connect, *credentials)
    assert (nobody.returncode, "--by" in nobody.stderr) == (2, True)
    given = ("--by", "ann", "--reason", "load set down")
    done = plumbline("remote", "acknowledge", str(incident), *given, *connect, *credentials)
    assert done.returncode == 0, done.stderr

    def refusal() -> bool:
        """A gateway that is starved of time may leave the question without an answer."""
        unknown = plumbline("remote", "acknowledge", "none-1", "--by", "ann", *connect, *credentials)
        return (unknown.returncode, "no incident none-1" in unknown.stderr) == (1, True)

    wait_until(refusal, "the refusal of an unknown incident")

    def acknowledged() -> list[tuple[str | None, str | None]]:
        changes = [event.change for event in follower.events if event.change]
        return [(each.acknowledged_by, each.reason) for each in changes if each.event == "acknowledged"]

    follower.until(acknowledged, "the acknowledgement")
    assert set(acknowledged()) == {("ann", "load set down")}
    follower.receiver.close()
    gateway.stop()
    info = plumbline("record", "info", gateway.data_dir)
    assert "acknowledged by ann" in info.stdout
    replay = plumbline("record", "replay", gateway.data_dir)
    assert replay.returncode == 0, replay.stdout


def test_watch_prints_each_alert_once_resumes_and_survives_hostile_messages(
    start_gateway: StartGateway, router: BusRouter, plumbline: Plumbline, tmp_path: Path
) -> None:
    gateway = start_gateway(CHATTERING, environment=connected(router))
    follower = Follower(router)
    follower.until_count(2)
    arguments = ("remote", "watch", "--connect", router.endpoint, "--resume", tmp_path / "watch.json", "--since", "0")
    command = [sys.executable, "-m", "gateway", *map(str, arguments)]
    watch = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert watch.stdout is not None
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([router.endpoint]))
    config.insert_json5("mode", '"client"')
    config.insert_json5("scouting/multicast/enabled", "false")
    hostile = zenoh.open(config)
    printed: list[int] = []
    while len(printed) < 4:
        for topic in ("alert", "swing", "condition"):
            hostile.put(f"{KEY}/{topic}", b"\xff\xfe")
            hostile.put(f"{KEY}/{topic}", b'{"text": "\x1b[2J"}')
        line = watch.stdout.readline()
        assert line.isprintable() or line.rstrip("\n").isprintable()
        content = json.loads(line)
        if content.get("key") == f"{KEY}/alert":
            printed.append(content["message"]["alert_number"])
    watch.kill()
    watch.communicate()
    assert printed == list(range(1, len(printed) + 1))
    follower.until_count(len(printed) + 2)
    again = plumbline(*arguments, "--topics", "alert", "--count", "3")
    numbers = [json.loads(line)["message"]["alert_number"] for line in again.stdout.splitlines() if "message" in line]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert numbers[0] in (printed[-1], printed[-1] + 1)  # the last may be repeated: it was printed before it was noted
    hostile.close()
    follower.receiver.close()
    gateway.stop()


def test_the_example_of_the_documentation_prints_the_changes(start_gateway: StartGateway, tmp_path: Path) -> None:
    gateway = start_gateway(CHATTERING)
    text = (ROOT / "docs" / "guides" / "integrator" / "alerts.md").read_text()
    program = text.split("```python\n")[1].split("```")[0].replace("tcp/127.0.0.1:7447", gateway.endpoint)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", program], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    lines = (line for line in process.stdout if "raised" in line)
    assert next(lines).startswith(f"{KEY} ")
    wait_until((tmp_path / "alerts.json").exists, "its position")
    process.kill()
    process.communicate()
    assert KEY in json.loads((tmp_path / "alerts.json").read_text())
    gateway.stop()
