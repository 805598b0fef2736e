"""Recalibration from afar with real processes: a radio on a pseudo-terminal that is turned, a gateway, the command line."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from gateway import messages
from gateway.recording.reading.recording_file import open_recording
from tests.benchmarks.turned_radio import COUNTS_PER_G, FACES, GAIN, OFFSET_G, TurnedRadio
from tests.system.conftest import ROOT, Completed, JoinBus, Plumbline, StartGateway
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

REMOTE = (sys.executable, "-m", "gateway", "remote")
TOML = '[device]\nkind = "witmotion"\nport = "{port}"\nodr_hz = 400\nserial = "{serial}"\n[housing]\nposition_m = 5\n'
TOML += "[recorder]\nsegment_s = 1\nfsync_s = 0.2\n"


@pytest.fixture
def radio(tmp_path: Path) -> Iterator[TurnedRadio]:
    made = TurnedRadio(tmp_path / "radio")
    yield made
    made.close()


class Site:
    """A gateway with the radio, killed and started again at will, and the command line of somebody far away."""

    def __init__(
        self, start_gateway: StartGateway, join_bus: JoinBus, radio: TurnedRadio, plumbline: Plumbline
    ) -> None:
        self._start, self._join, self.radio, self._plumbline = start_gateway, join_bus, radio, plumbline
        self.gateway = start_gateway(self._toml("hook-7"))
        self.endpoint: str = self.gateway.endpoint
        self._listen()

    def _toml(self, serial: str) -> str:
        return TOML.format(port=self.radio.link, serial=serial)

    def start(self, serial: str = "hook-7") -> None:
        environment = {"PLUMBLINE_BUS__LISTEN": json.dumps([self.endpoint])}
        self.gateway = self._start(self._toml(serial), environment=environment)
        self._listen()

    def _listen(self) -> None:
        self.peer = self._join(self.endpoint)
        self.peer.wait_for("health")

    def kill(self) -> None:
        self.gateway.process.kill()
        self.gateway.process.communicate()

    def remote(self, *arguments: str) -> Completed:
        return self._plumbline("remote", *arguments, "--connect", self.endpoint)

    def follow(self, *arguments: str) -> subprocess.Popen[str]:
        """Begin to run a command that takes a while."""
        command = [*REMOTE, *arguments, "--connect", self.endpoint]
        return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def wait_session(self, wanted: Callable[[Any], bool]) -> Any:
        return self.peer.wait_for("calibration", lambda message: wanted(message["session"]))["session"]

    def take(self, face: str) -> Any:
        """Turn the radio, and wait until this face is taken; it may have rested on another one before."""
        self.radio.turn(face)
        return self.wait_session(
            lambda session: face in [pose["face"] for pose in session["poses"]] or session["phase"] == "review"
        )

    def next_segment(self, calibration_id: str | None) -> Path:
        """The first segment that begins from now on, once messages of this calibration are in it."""
        now = self.gateway.recordings[-1]
        return Path(
            self.peer.wait_for(
                "health",
                lambda health: (
                    health["calibration_id"] == calibration_id
                    and health["recording"] is not None
                    and Path(health["recording"]) > now
                ),
            )["recording"]
        )

    @property
    def data_dir(self) -> Path:
        return self.gateway.data_dir


@pytest.fixture
def site(start_gateway: StartGateway, join_bus: JoinBus, radio: TurnedRadio, plumbline: Plumbline) -> Site:
    return Site(start_gateway, join_bus, radio, plumbline)


def test_a_session_leads_to_a_record_in_spite_of_a_kill(site: Site, tmp_path: Path, plumbline: Plumbline) -> None:
    assert site.remote("commit", "--by", "ann").returncode == 1  # nothing is in review
    follower = site.follow("recalibrate", "--by", "ann", "--housing-off-rope")
    site.wait_session(lambda session: session["phase"] == "collecting")
    assert site.remote("recalibrate", "--by", "bob", "--housing-off-rope").returncode == 1  # one at a time
    before: list[Path] = []
    for number, face in enumerate(FACES, start=1):
        site.take(face)
        if number == 3:
            site.kill()
            before = site.gateway.recordings
            site.start()
    suspended = site.peer.wait_for("alert", lambda message: "SUSPENDED" in message["text"])
    assert suspended["level"] == "unknown"
    condition = site.peer.wait_for("condition", lambda message: "SUSPENDED" in message["reasons"][0])
    assert not condition["trusted"]
    out, err = follower.communicate(timeout=PATIENCE_S)
    assert follower.returncode == 0, out + err
    assert "in review" in out

    site.radio.turn("+z")
    committed = site.remote("commit", "--by", "bob", "--reason", "first record")
    assert committed.returncode == 0, committed.stderr
    message = site.peer.wait_for("calibration", lambda message: message["status"] == "calibrated")
    record = message["record"]
    assert (record["method"], record["by"], record["parent"]) == ("six-position", "ann", None)
    assert message["calibration_id"] == record["id"]
    assert site.peer.wait_for("tilt", lambda tilt: tilt["calibration_id"] == record["id"])
    expected = np.linalg.inv(GAIN) / COUNTS_PER_G
    np.testing.assert_allclose(
        np.array(record["correction_matrix"]) / expected.max(), expected / expected.max(), atol=2e-3
    )
    np.testing.assert_allclose(np.array(record["offset"]) / COUNTS_PER_G, OFFSET_G, atol=5e-4)

    assert site.peer.wait_for("health", lambda health: health["calibration_id"] == record["id"])["drift"]

    fetched_to = tmp_path / "fetched" / "records"  # the command makes it
    fetched = site.remote("fetch", "--out", str(fetched_to))
    assert fetched.returncode == 0, fetched.stderr
    assert json.loads((fetched_to / f"{record['id']}.json").read_text()) == record
    assert "Calibration certificate" in (fetched_to / f"{record['id']}.html").read_text()
    assert "digitalCalibrationCertificate" in (fetched_to / f"{record['id']}.xml").read_text()
    status = json.loads(site.remote("status", "--json", "-").stdout)
    (topics,) = status.values()
    assert topics["drift"]["at_rest"].startswith("not known yet")
    assert "two calibrations at least" in topics["drift"]["by_records"]
    history = json.loads((fetched_to / "in_force.json").read_text())["history"]
    assert [(line["by"], line["reason"], line["to"]) for line in history] == [("bob", "first record", record["id"])]
    asked = [json.loads(line) for line in (fetched_to / "audit.jsonl").read_text().splitlines()]
    assert [(entry["verb"], entry["by"], entry["accepted"]) for entry in asked if entry["event"] == "request"] == [
        ("commit", "ann", False),
        ("recalibrate", "ann", True),
        ("recalibrate", "bob", False),
        ("commit", "bob", True),
    ]

    with_record = site.next_segment(record["id"])
    assert site.remote("rollback", "--by", "bob").returncode == 0
    assert site.peer.wait_for(
        "calibration",
        lambda message: message["status"] == "uncalibrated" and message["session"]["phase"] == "committed",
    )
    without = site.next_segment(None)
    site.gateway.stop(signal.SIGTERM)
    replayed = plumbline("record", "replay", *(path for path in site.gateway.recordings if path not in before))
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    kept, none = attached(with_record), attached(without)
    assert json.loads(kept[f"calibration-{record['id']}.json"]) == record
    assert b"Calibration certificate" in kept[f"calibration-{record['id']}.html"]
    assert not [name for name in none if name.startswith("calibration-")]
    lines = [
        decoded.message
        for path in site.gateway.recordings
        for file in [open_recording(path)]
        for message in file.messages()
        if isinstance(decoded := file.decode(message), messages.Log)
    ]
    assert sum('"verb": "commit"' in line for line in lines) == 2
    told = [line.partition("in force: ")[2] for line in lines if "calibration in force: " in line]
    assert told[0].startswith("uncalibrated")
    assert [record["id"] in line for line in told[-2:]] == [True, False]


def attached(path: Path) -> dict[str, bytes]:
    """Content of each attachment of a closed recording, by name."""
    with path.open("rb") as file:
        return {one.name: one.data for one in make_reader(file).iter_attachments()}
