"""A gateway with a relay, and a program at the end of the wire that writes down how it is called."""

import signal
from pathlib import Path

import pytest

from tests.gateway.daemon.outputs.relay_script import ScriptedRelay
from tests.system.conftest import JoinBus, StartGateway
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

CALM = "[alerts]\nwarn_deg = 80\ntrip_deg = 85\nclear_deg = 70\nlean_trip_deg = 80\n"


def configuration(relay: ScriptedRelay, watchdog_s: float, rest: str = CALM) -> str:
    return f'{rest}[relay]\nkind = "command"\ncommand = ["{relay.path}"]\nwatchdog_s = {watchdog_s}\nunknown_s = 30\n'


@pytest.mark.parametrize("name", [signal.SIGKILL, signal.SIGTERM])
def test_a_gateway_that_ends_or_is_killed_drops_the_relay(
    start_gateway: StartGateway, tmp_path: Path, name: signal.Signals
) -> None:
    relay = ScriptedRelay(tmp_path)
    gateway = start_gateway(configuration(relay, watchdog_s=60))
    wait_until(lambda: relay.state == "energise", "the relay")
    gateway.process.send_signal(name)
    wait_until(lambda: relay.state == "release", "the drop", patience_s=30)  # the watchdog alone would take a minute
    gateway.wait()
    assert relay.calls[0] == "release"


def test_a_frozen_gateway_drops_the_relay_and_energises_it_when_it_goes_on(
    start_gateway: StartGateway, tmp_path: Path
) -> None:
    relay = ScriptedRelay(tmp_path)
    gateway = start_gateway(configuration(relay, watchdog_s=2))
    wait_until(lambda: relay.state == "energise", "the relay")
    gateway.process.send_signal(signal.SIGSTOP)
    wait_until(lambda: relay.state == "release", "the watchdog")
    gateway.process.send_signal(signal.SIGCONT)
    wait_until(lambda: relay.state == "energise", "the relay again")


def test_a_limit_drops_the_relay_and_a_broken_output_stops_no_sample(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    relay = ScriptedRelay(tmp_path)
    limits = "[alerts]\nwarn_deg = 0.02\ntrip_deg = 0.03\nclear_deg = 0.01\n"
    gateway = start_gateway(configuration(relay, watchdog_s=2, rest=limits))
    peer = join_bus(gateway.endpoint)
    peer.wait_for("alert", lambda alert: alert["level"] == "trip")
    health = peer.wait_for("health", lambda message: message["relay"] == "released" and message["relay_reason"])
    assert "swing trip" in health["relay_reason"] or "not known" in health["relay_reason"]
    assert "energise" not in relay.calls
    relay.break_by("hang")
    after = peer.wait_for("health", lambda message: message["faults"].get("relay_failures", 0) >= 1)
    later = peer.wait_for("health", lambda message: message["sequence"] >= after["sequence"] + 3)
    assert later["samples"] > after["samples"]
    assert (later["lost"], later["dropped"]) == (after["lost"], after["dropped"])
