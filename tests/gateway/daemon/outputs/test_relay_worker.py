"""When the relay drops: by the alerts, and with whatever dies or hangs: the gateway, its thread, the process, the output."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gateway.configuration.relay_section import CommandRelay, GpioRelay
from gateway.daemon.outputs import relay_worker
from gateway.daemon.outputs.relay_watchdog import ENERGISE
from gateway.daemon.outputs.relay_worker import RelayLogic, RelayWorker
from gateway.daemon.runtime.worker import FaultRegister
from gateway.messages import ActiveAlert, Alert, Level
from tests.gateway.daemon.outputs.relay_script import FakeGpioChip, ScriptedRelay
from tests.system.conftest import ROOT
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

NORMAL = Alert(
    time_ns=0,
    clock="synchronised",
    sequence=0,
    level="normal",
    validity="valid",
    event="standing",
    active=[],
    text="normal",
)
TRIP = Alert(
    time_ns=0,
    clock="synchronised",
    sequence=1,
    level="trip",
    event="raised",
    active=[ActiveAlert(rule="swing", level="trip", since_ns=0, value_deg=7.0, text="swing trip")],
    text="swing trip",
)


@pytest.fixture
def relay(tmp_path: Path) -> ScriptedRelay:
    return ScriptedRelay(tmp_path)


Start = Callable[[CommandRelay | GpioRelay], RelayWorker]


@pytest.fixture
def start() -> Iterator[Start]:
    workers: list[RelayWorker] = []

    def begin(settings: CommandRelay | GpioRelay) -> RelayWorker:
        worker = RelayWorker(settings, FaultRegister())
        workers.append(worker)
        worker.start()
        return worker

    yield begin
    for worker in workers:
        worker.finish()
        worker.join(PATIENCE_S)


def command(relay: ScriptedRelay, **changes: Any) -> CommandRelay:
    return CommandRelay(kind="command", command=[str(relay.path)], **{"watchdog_s": 1.5, **changes})


def hold(worker: RelayWorker, condition: Callable[[], object], what: str) -> None:
    """Send an alert that is well every tenth of a second until a condition holds."""

    def met() -> object:
        worker.inbox.put(NORMAL)
        time.sleep(0.1)
        return condition()

    wait_until(met, what)


@pytest.mark.slow
def test_the_relay_is_released_at_start_energised_while_well_and_dropped_by_a_trip(
    relay: ScriptedRelay, start: Start
) -> None:
    worker = start(command(relay, watchdog_s=60, command_timeout_s=10))
    wait_until(lambda: relay.calls == ["release"], "the release at start")
    hold(worker, lambda: worker.state == "energised", "the relay")
    worker.inbox.put(TRIP)
    wait_until(lambda: worker.state == "released", "the drop")
    assert relay.calls == ["release", "energise", "release"]
    assert worker.reason == "swing trip"
    assert not any(worker.faults.values())


@pytest.mark.slow
def test_silence_of_the_alerts_drops_the_relay(relay: ScriptedRelay, start: Start) -> None:
    worker = start(command(relay))
    hold(worker, lambda: relay.state == "energise", "the relay")
    wait_until(lambda: relay.state == "release", "the watchdog")
    assert worker.state in ("released", "energised")
    wait_until(lambda: worker.state == "released", "the report of the watchdog")


@pytest.mark.slow
def test_the_end_of_the_thread_drops_the_relay(relay: ScriptedRelay, start: Start) -> None:
    worker = start(command(relay, watchdog_s=60, command_timeout_s=10))
    hold(worker, lambda: relay.state == "energise", "the relay")
    worker.finish()
    worker.join(PATIENCE_S)
    assert relay.state == "release"


@pytest.mark.slow
def test_a_killed_process_is_replaced_by_one_that_releases_first(relay: ScriptedRelay, start: Start) -> None:
    worker = start(command(relay))
    hold(worker, lambda: relay.state == "energise", "the relay")
    assert worker._process is not None
    worker._process.kill()
    wait_until(lambda: relay.state == "release", "the release by the next process")
    hold(worker, lambda: relay.state == "energise", "the relay again")
    assert worker.faults["relay_restarted"] >= 1


@pytest.mark.slow
def test_a_process_that_hangs_is_replaced(relay: ScriptedRelay, start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(relay_worker, "MAX_RELAY_ANSWER_S", -0.5)
    worker = start(command(relay, command_timeout_s=0.5))
    hold(worker, lambda: relay.state == "energise", "the relay")
    assert worker._process is not None
    worker._process.send_signal(signal.SIGSTOP)
    hold(worker, lambda: relay.calls.count("release") >= 2, "the release by the next process")
    hold(worker, lambda: relay.state == "energise", "the relay again")
    assert worker.faults["relay_not_confirmed"] >= 1


@pytest.mark.slow
@pytest.mark.parametrize("how", ["fail", "hang"])
def test_a_command_that_fails_or_hangs_is_counted_and_never_blocks_the_thread(
    relay: ScriptedRelay, start: Start, how: str
) -> None:
    worker = start(command(relay, watchdog_s=60, command_timeout_s=2, repeat_s=1.0))
    hold(worker, lambda: worker.state == "energised", "the relay")
    relay.break_by(how)

    def failed() -> bool:
        worker.inbox.put(NORMAL)
        wait_until(lambda: len(worker.inbox) == 0, "the thread")
        return worker.state == "failed"

    wait_until(failed, "the failure")
    assert worker._register.counts == {"relay_failures": 1}
    assert "it cannot be switched" in worker._register.standing["relay"]
    assert worker.inbox.dropped == 0
    relay.mend(how)
    hold(worker, lambda: worker.state == "energised", "the relay again")


@pytest.mark.slow
def test_a_command_that_does_not_exist_is_a_fault_and_no_end(tmp_path: Path, start: Start) -> None:
    worker = start(CommandRelay(kind="command", command=[str(tmp_path / "nothing")]))
    wait_until(lambda: worker.state == "failed", "the failure")
    assert worker.is_alive()


PARENT = """
import sys, time
from gateway.configuration.relay_section import CommandRelay
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.outputs.relay_worker import RelayWorker
from tests.gateway.daemon.outputs.test_relay_worker import NORMAL
worker = RelayWorker(CommandRelay(kind="command", command=[sys.argv[1]], watchdog_s=60.0), FaultRegister())
worker.start()
while True:
    worker.inbox.put(NORMAL)
    time.sleep(0.1)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", [signal.SIGKILL, signal.SIGSEGV])
def test_the_death_of_the_gateway_drops_the_relay_at_once(relay: ScriptedRelay, name: signal.Signals) -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(relay.path)], cwd=ROOT)
    wait_until(lambda: relay.state == "energise", "the relay")
    parent.send_signal(name)
    parent.wait(PATIENCE_S)
    wait_until(lambda: relay.state == "release", "the drop", patience_s=30.0)  # by the pipe: the watchdog takes 60 s


@pytest.mark.slow
def test_a_frozen_gateway_drops_the_relay(relay: ScriptedRelay) -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT.replace("60.0", "1.5"), str(relay.path)], cwd=ROOT)
    try:
        wait_until(lambda: relay.state == "energise", "the relay")
        parent.send_signal(signal.SIGSTOP)
        wait_until(lambda: relay.state == "release", "the watchdog")
    finally:
        parent.kill()
        parent.wait()


@pytest.mark.slow
def test_lines_that_never_end_do_not_postpone_the_release(relay: ScriptedRelay) -> None:
    watched = subprocess.Popen(
        [sys.executable, "-m", "gateway.daemon.outputs.relay_watchdog"], cwd=ROOT, stdin=subprocess.PIPE
    )
    pipe = present(watched.stdin).fileno()

    def state_after(word: bytes) -> str | None:
        os.write(pipe, word)
        return relay.state

    try:
        os.write(pipe, relay_worker.relay_parameters(command(relay)).encode())
        wait_until(lambda: state_after(ENERGISE) == "energise", "the relay")
        time.sleep(0.5)  # for the last whole line
        watched.send_signal(signal.SIGSTOP)  # so that a part of a line waits when the 1.5 s of the watchdog are over
        os.write(pipe, b"e")
        time.sleep(2.0)
        watched.send_signal(signal.SIGCONT)
        wait_until(lambda: state_after(b"e") == "release", "the release")
    finally:
        watched.kill()
        watched.communicate()


@pytest.mark.slow
def test_a_gpio_line_is_high_while_well_and_low_before_and_after(
    tmp_path: Path, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    chip = FakeGpioChip(tmp_path)
    monkeypatch.setenv("PYTHONPATH", chip.path)
    worker = start(GpioRelay(kind="gpio", line=17, watchdog_s=1.5))
    hold(worker, lambda: chip.levels[-1:] == ["high"], "the line")
    assert chip.levels[0] == "low"
    worker.inbox.put(TRIP)
    wait_until(lambda: chip.levels[-1] == "low", "the drop")
    worker.finish()
    worker.join(PATIENCE_S)
    assert chip.levels[-2:] == ["low", "returned"]


@pytest.mark.slow
def test_an_active_low_line_is_inverted_and_a_pulse_is_a_square_wave(
    tmp_path: Path, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    chip = FakeGpioChip(tmp_path)
    monkeypatch.setenv("PYTHONPATH", chip.path)
    worker = start(GpioRelay(kind="gpio", line=3, active_low=True, pulse_hz=20.0, watchdog_s=1.5))
    hold(worker, lambda: len(chip.levels) > 20, "the pulse")
    assert chip.levels[0] == "high"  # released
    worker.inbox.put(TRIP)
    wait_until(lambda: worker.state == "released", "the drop")
    edges = chip.levels[chip.levels.index("low") :]
    assert edges.count("low") > 5
    assert [level for level in edges if level not in ("low", "high")] == []
    count = chip.levels.count("low")
    time.sleep(0.3)
    assert (chip.levels.count("low"), chip.levels[-1]) == (count, "high")


@pytest.mark.slow
def test_a_line_that_fails_is_reported(tmp_path: Path, start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    chip = FakeGpioChip(tmp_path)
    monkeypatch.setenv("PYTHONPATH", chip.path)
    worker = start(GpioRelay(kind="gpio", line=17))
    hold(worker, lambda: worker.state == "energised", "the line")
    chip.break_line()
    hold(worker, lambda: worker.state == "failed", "the failure")


@pytest.mark.slow
def test_a_chip_that_is_not_there_is_a_fault_and_no_end(start: Start) -> None:
    worker = start(GpioRelay(kind="gpio", chip=Path("/dev/no-such-chip"), line=1))
    wait_until(lambda: worker.faults["relay_restarted"] >= 1, "another attempt")
    assert worker.state == "failed"
    assert worker.is_alive()


UNKNOWN_S = 5.0


def settings(**changes: Any) -> CommandRelay:
    return CommandRelay(kind="command", command=["relay"], **{"unknown_s": UNKNOWN_S, **changes})


def active(level: Level, rule: str = "swing", value_deg: float | None = 7.0, by: str | None = None) -> ActiveAlert:
    return ActiveAlert(
        rule=rule, level=level, since_ns=0, value_deg=value_deg, acknowledged_by=by, text=f"{rule} {level}"
    )


def alert(*alerts: ActiveAlert) -> Alert:
    rank: list[Level] = ["normal", "unknown", "warn", "trip"]
    level = rank[max((rank.index(each.level) for each in alerts), default=0)]
    return Alert(
        time_ns=0,
        clock="synchronised",
        sequence=0,
        level=level,
        validity="valid",
        event="standing",
        active=[*alerts],
        text="text",
    )


ALL_NORMAL = alert()


def logic(**changes: Any) -> RelayLogic:
    """One that has seen a known level."""
    known = RelayLogic(settings(**changes))
    assert known.judge(ALL_NORMAL, 0.0).energised
    return known


def test_the_relay_stays_released_until_a_level_is_known() -> None:
    relay = RelayLogic(settings())
    assert not relay.judge(alert(active("unknown")), 0.0).energised
    assert not relay.judge(alert(active("unknown")), 1.0).energised
    assert relay.judge(ALL_NORMAL, 2.0).energised


@pytest.mark.parametrize(("drop_at", "level", "energised"), [
    ("trip", "trip", False), ("trip", "warn", True), ("warn", "warn", False), ("warn", "trip", False),
])  # fmt: skip
def test_the_configured_level_drops_the_relay(drop_at: str, level: Level, energised: bool) -> None:
    decision = logic(drop_at=drop_at).judge(alert(active(level)), 1.0)
    assert decision.energised is energised
    assert decision.reason == ("" if energised else f"swing {level}")


def test_a_trip_drops_the_relay_while_its_value_is_not_known() -> None:
    assert not logic().judge(alert(active("trip", value_deg=None)), 1.0).energised


def test_an_unknown_level_drops_the_relay_after_its_time_and_a_known_one_brings_it_back() -> None:
    relay = logic()
    unknown = alert(active("unknown", value_deg=None))
    assert relay.judge(unknown, UNKNOWN_S).energised
    decision = relay.judge(unknown, UNKNOWN_S + 0.1)
    assert not decision.energised
    assert decision.reason.startswith("not known for more than 5 s")
    assert relay.judge(ALL_NORMAL, UNKNOWN_S + 1.0).energised


def test_a_warning_without_a_known_value_counts_as_unknown() -> None:
    relay = logic()
    assert relay.judge(alert(active("warn", value_deg=None)), 1.0).energised
    assert not relay.judge(alert(active("warn", value_deg=None)), UNKNOWN_S + 1.1).energised


def test_a_warning_does_not_hide_that_another_rule_is_unknown() -> None:
    relay = logic()
    both = alert(active("warn"), active("unknown", "lean", None))
    assert not relay.judge(both, UNKNOWN_S + 0.1).energised


def test_a_warning_of_the_calibration_has_no_value_and_is_not_unknown() -> None:
    assert logic().judge(alert(active("warn", "calibration", None)), UNKNOWN_S + 1.0).energised


@pytest.mark.parametrize("validity", ["no_samples", "suspended", "uncalibrated", "not_known"])
def test_a_normal_level_that_is_not_valid_counts_as_unknown(validity: Any) -> None:
    relay = logic()
    assert relay.judge(replace(ALL_NORMAL, validity=validity), UNKNOWN_S).energised
    assert not relay.judge(replace(ALL_NORMAL, validity=validity), UNKNOWN_S + 0.1).energised
    assert relay.judge(replace(ALL_NORMAL, validity="valid"), UNKNOWN_S + 0.2).energised


def test_an_acknowledged_incident_holds_the_relay_dropped_unless_it_drives_a_horn() -> None:
    acknowledged = alert(active("trip", by="ann"))
    assert not logic().judge(acknowledged, 1.0).energised
    horn = logic(ignore_acknowledged=True)
    assert horn.judge(acknowledged, 1.0).energised
    assert not horn.judge(alert(active("trip", by="ann"), active("trip", "lean")), 1.0).energised


def test_a_level_without_an_entry_of_its_rule_drops_the_relay() -> None:
    trip = Alert(time_ns=0, clock="synchronised", sequence=0, level="trip", event="standing", active=[], text="?")
    assert not logic().judge(trip, 1.0).energised
