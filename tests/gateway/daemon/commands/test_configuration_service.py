"""Changes of the configuration: who, what and why are on the disk, and only health confirms."""

import json
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.authorization.caller import Caller, Role
from gateway.configuration.loading import load_text
from gateway.configuration.remote_change import MAX_TRIAL_STARTS
from gateway.daemon.commands.configuration_service import DEADLINE_S, HEALTHY_S, ConfigurationService, TrialSupervisor
from gateway.daemon.commands.requests import RemoteRequest
from gateway.recalibration.requests import ApplyConfiguration, ProposeConfiguration, ReadConfiguration, Request

FILE = '[gateway]\nsite = "yard"\n\n[alerts]\ntrip_deg = 6.0  # agreed with the owner\n'
ANN = Caller("ann", Role.SERVICE, "token")


class Bench:
    """A gateway's service with its file; `start` is the next start of the gateway."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "plumbline.toml"
        self.path.write_text(FILE)
        self.data_dir = folder / "data"
        self.start()

    def start(self) -> str:
        self.service = ConfigurationService(self.path, service=False, environment={})
        outcome = self.service.resume()
        self.handlers = self.service.open(self.data_dir)
        return outcome

    def ask(self, verb: str, content: Request) -> tuple[bool, dict[str, Any]]:
        answers: list[tuple[bool, dict[str, Any]]] = []
        request = RemoteRequest(verb, content, ANN, lambda accepted, answer: answers.append((accepted, dict(answer))))
        self.handlers[verb](request)
        (answer,) = answers
        return answer

    def propose(self, trip_deg: float = 5.0, request_id: str = "propose-1", **more: Any) -> tuple[bool, dict[str, Any]]:
        proposal = {"alerts": {"trip_deg": trip_deg}}
        return self.ask("config_propose", ProposeConfiguration(id=request_id, by="ann", proposal=proposal, **more))

    def apply(self, proposal: str = "propose-1", request_id: str = "apply-001") -> tuple[bool, dict[str, Any]]:
        return self.ask(
            "config_apply", ApplyConfiguration(id=request_id, by="ann", reason="shorter sling", proposal=proposal)
        )

    @property
    def events(self) -> list[str]:
        path = self.data_dir / "configuration" / "audit.jsonl"
        return [json.loads(line)["event"] for line in path.read_text().splitlines()]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_a_proposal_is_shown_as_a_difference_and_changes_nothing(bench: Bench) -> None:
    accepted, answer = bench.propose()
    assert accepted
    assert answer["changes"] == [{"key": "alerts.trip_deg", "before": 6.0, "after": 5.0}]
    assert bench.path.read_text() == FILE
    assert not bench.service.restart_wanted


def test_a_proposal_that_voids_another_one_says_which(bench: Bench) -> None:
    assert bench.propose()[1]["voids"] is None
    assert bench.propose(keep=False, request_id="validate-1")[1]["voids"] is None
    assert bench.propose(4.0, "propose-2")[1]["voids"] == "propose-1"
    assert bench.propose(4.0, "propose-2")[1]["voids"] is None
    assert bench.apply("propose-2")[0]
    entry = json.loads((bench.data_dir / "configuration" / "audit.jsonl").read_text().splitlines()[-1])
    assert (entry["id"], entry["proposal"]) == ("apply-001", "propose-2")
    bench.start()
    bench.service.confirm()
    assert bench.propose(4.5, "propose-3")[1]["voids"] is None


def test_a_validated_change_is_not_kept(bench: Bench) -> None:
    accepted, answer = bench.propose(keep=False)
    assert accepted
    assert answer["proposal"] is None
    assert bench.apply() == (
        False,
        {"id": "apply-001", "accepted": False, "reason": "there is no proposal propose-1; propose it again"},
    )


def test_an_applied_change_is_audited_before_it_is_in_force_and_confirmed_by_health(bench: Bench) -> None:
    bench.propose(reason="new rope")
    accepted, _ = bench.apply()
    assert accepted
    assert bench.service.restart_wanted
    assert "trip_deg = 5.0  # agreed with the owner" in bench.path.read_text()
    assert bench.start() == "continued"
    bench.service.confirm()
    assert bench.events == ["proposed", "applied", "confirmed"]
    entry = json.loads((bench.data_dir / "configuration" / "audit.jsonl").read_text().splitlines()[1])
    assert (entry["by"], entry["reason"]) == ("ann", "shorter sling")
    assert entry["changes"] == ["alerts.trip_deg: 6.0 -> 5.0"]
    assert entry["proposed_reason"] == "new rope"
    assert bench.start() == "none"


def test_a_repeated_apply_is_done_once(bench: Bench) -> None:
    bench.propose()
    assert bench.apply()[0]
    bench.start()
    assert bench.apply()[0]
    assert bench.events == ["proposed", "applied"]
    accepted, answer = bench.apply(request_id="apply-002")
    assert not accepted
    assert "is on trial" in answer["reason"]


def test_a_configuration_that_was_edited_since_the_proposal_stays(bench: Bench) -> None:
    bench.propose()
    bench.path.write_text(FILE + "[rope]\nlength_m = 13.0\n")
    accepted, answer = bench.apply()
    assert not accepted
    assert "has been changed since the proposal" in answer["reason"]


def test_a_gateway_that_never_becomes_healthy_is_rolled_back_and_says_so(bench: Bench) -> None:
    bench.propose()
    bench.apply()
    assert [bench.start() for _ in range(MAX_TRIAL_STARTS + 1)] == ["continued"] * MAX_TRIAL_STARTS + ["rolled_back"]
    assert bench.path.read_text() == FILE
    assert bench.events == ["proposed", "applied", "rolled_back"]
    accepted, answer = bench.ask("config_get", ReadConfiguration(id="read-0001", by="ann"))
    assert accepted
    assert answer["on_trial"] is None
    assert answer["history"][-1]["why"] == "the gateway did not become healthy in 3 starts"


def test_the_configuration_is_read_without_files_and_commands(bench: Bench) -> None:
    bench.path.write_text(
        '[gateway]\nsite = "yard"\ndata_dir = "/srv"\n[recorder]\nkey = "/etc/key.pem"\n[mqtt]\npassword = "x"\n'
    )
    _, answer = bench.ask("config_get", ReadConfiguration(id="read-0001", by="ann"))
    assert answer["configuration"] == {"gateway": {"site": "yard"}, "recorder": {}}


def test_without_a_file_nothing_can_be_changed(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.handlers = ConfigurationService(None, service=False, environment={}).open(bench.data_dir)
    accepted, answer = bench.propose()
    assert not accepted
    assert "without a configuration file" in answer["reason"]


def test_a_service_refuses_a_change_to_a_simulated_crane(bench: Bench) -> None:
    bench.path.write_text('[device]\nkind = "adxl355"\n')
    bench.handlers = ConfigurationService(bench.path, service=True, environment={}).open(bench.data_dir)
    wanted = ProposeConfiguration(id="propose-1", by="ann", proposal={"device": {"kind": "simulated"}})
    accepted, answer = bench.ask("config_propose", wanted)
    assert not accepted
    assert "is no sensor" in answer["reason"]


def _supervise(bench: Bench, problem_at: Callable[[float], str | None]) -> int | None:
    """Run a trial in steps of a second; return when it ended."""
    bench.propose()
    bench.apply()
    bench.start()
    stopping = threading.Event()
    supervisor = TrialSupervisor(bench.service, problem_at, stopping, 0.0)
    for second in range(200):
        supervisor.tick(float(second))
        if not bench.service.on_trial:
            assert stopping.is_set() == bench.service.restart_wanted
            return second
    return None


def test_an_interruption_starts_the_healthy_seconds_again(bench: Bench) -> None:
    assert _supervise(bench, lambda second: "no samples arrive" if second == 5 else None) == 6 + HEALTHY_S
    assert bench.events[-1] == "confirmed"


def test_ten_healthy_seconds_confirm(bench: Bench) -> None:
    assert _supervise(bench, lambda _: None) == HEALTHY_S
    assert bench.events[-1] == "confirmed"


def test_a_gateway_without_samples_is_rolled_back_in_time(bench: Bench) -> None:
    assert _supervise(bench, lambda _: "no samples arrive") == DEADLINE_S
    assert bench.path.read_text() == FILE
    assert bench.service.restart_wanted
    bench.start()
    assert bench.events[-1] == "rolled_back"


DAMAGES: dict[str, Callable[[Path], object]] = {
    "deep": lambda path: path.write_bytes(b"[" * 100_000),
    "not UTF-8": lambda path: path.write_bytes(b"\xff\xfe{"),
    "empty": lambda path: path.write_bytes(b""),
    "a folder": Path.mkdir,
    "a pipe": os.mkfifo,
    "a link to a device": lambda path: path.symlink_to("/dev/zero"),
    "a link to nothing": lambda path: path.symlink_to("nowhere"),
}


@pytest.mark.parametrize("damage", list(DAMAGES))
def test_a_damaged_journal_or_proposal_keeps_no_gateway_from_starting(bench: Bench, damage: str) -> None:
    DAMAGES[damage](bench.path.with_name("plumbline.toml.trial.json"))
    (bench.data_dir / "configuration").mkdir(parents=True, exist_ok=True)
    DAMAGES[damage](bench.data_dir / "configuration" / "proposal.json")
    bench.start()
    TrialSupervisor(bench.service, lambda _: None, threading.Event(), 0.0).tick(0.0)
    accepted, answer = bench.apply()
    assert not accepted
    assert "propose it again" in answer["reason"]
    assert bench.path.read_text() == FILE


@pytest.mark.slow
def test_no_flipped_bit_of_the_journal_keeps_a_gateway_from_starting(bench: Bench) -> None:
    bench.propose()
    bench.apply()
    journal = bench.path.with_name("plumbline.toml.trial.json")
    changed = bench.path.read_bytes()
    files = {path: path.read_bytes() for path in (journal, bench.data_dir / "configuration" / "proposal.json")}
    for path, whole in files.items():
        for place in range(len(whole)):
            for each, content in files.items():
                each.write_bytes(content)
            bench.path.write_bytes(changed)
            path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1 :])
            bench.start()
            load_text(bench.path.read_text(), "the file", {})
