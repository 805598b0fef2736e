"""Recalibration from afar with real processes: a radio on a pseudo-terminal that is turned, a gateway, the command line."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from mcap.reader import make_reader

from devices.replay import table_info
from devices.table import read_table
from devices.table_layout import TableLayout
from gateway import messages
from gateway.authorization.credential import Challenge
from gateway.bus.credentials import load_credentials
from gateway.calibration.record_factory import add_content_hash
from gateway.calibration.store import CalibrationStore
from gateway.recording.reader import open_recording
from tests.benchmarks.turned_radio import COUNTS_PER_G, FACES, GAIN, NOISE_G, OFFSET_G, TurnedRadio
from tests.system.conftest import BusPeer, JoinBus, Plumbline, StartGateway
from tests.values import present
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
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

    def __init__(self, start_gateway: StartGateway, join_bus: JoinBus, radio: TurnedRadio) -> None:
        self._start, self._join, self.radio = start_gateway, join_bus, radio
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

    def command(self, *arguments: str) -> list[str]:
        return [*REMOTE, *arguments, "--connect", self.endpoint]

    def remote(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(*arguments), cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )

    def follow(self, *arguments: str) -> subprocess.Popen[str]:
        """Begin to run a command that takes a while."""
        return subprocess.Popen(
            self.command(*arguments), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

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
def site(start_gateway: StartGateway, join_bus: JoinBus, radio: TurnedRadio) -> Site:
    return Site(start_gateway, join_bus, radio)


def test_a_session_leads_to_a_record_in_spite_of_a_kill(site: Site, tmp_path: Path) -> None:
    assert site.remote("commit", "--by", "ann").returncode == 1  # nothing is in review
    follower = site.follow("recalibrate", "--by", "ann", "--housing-off-rope")
    site.wait_session(lambda session: session["phase"] == "collecting")
    assert site.remote("recalibrate", "--by", "bob", "--housing-off-rope").returncode == 1  # one at a time
    for number, face in enumerate(FACES, start=1):
        site.take(face)
        if number == 3:
            site.kill()
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

    fetched = site.remote("fetch", "--out", str(tmp_path))
    assert fetched.returncode == 0, fetched.stderr
    assert json.loads((tmp_path / f"{record['id']}.json").read_text()) == record
    assert "Calibration certificate" in (tmp_path / f"{record['id']}.html").read_text()
    status = json.loads(site.remote("status", "--json", "-").stdout)
    (topics,) = status.values()
    assert topics["drift"]["at_rest"].startswith("not known yet")
    assert "two calibrations at least" in topics["drift"]["by_records"]
    history = json.loads((tmp_path / "in_force.json").read_text())["history"]
    assert [(line["by"], line["reason"], line["to"]) for line in history] == [("bob", "first record", record["id"])]
    asked = [json.loads(line) for line in (tmp_path / "audit.jsonl").read_text().splitlines()]
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


KEY = "plumbline/v1/demo-site/crane-1/hook-1"


def query(
    peer: BusPeer, verb: str, payload: bytes | None, key: str = KEY, data_dir: Path | None = None
) -> list[tuple[bool, Any]]:
    """(accepted, content) of every answer; with the token of a data folder where one is given."""
    attachment = None
    if data_dir is not None:
        ((_, challenge),) = query(peer, "challenge", None)
        credentials = load_credentials(data_dir)
        attachment = credentials.prove(f"{key}/rpc/{verb}", payload or b"", Challenge.model_validate(challenge))
    replies = peer.session.get(f"{key}/rpc/{verb}", payload=payload, attachment=attachment, timeout=PATIENCE_S)
    return [(reply.ok is not None, _content(reply)) for reply in replies]


def _content(reply: zenoh.Reply) -> Any:
    if reply.ok is not None:
        return json.loads(reply.ok.payload.to_bytes())
    return json.loads(present(reply.err).payload.to_bytes())


def test_invalid_requests_are_refused_with_a_reason(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    good = json.dumps({"id": "request-1", "by": "eve", "housing_off_rope": True}).encode()
    for payload, said in (
        (b"", "id"),
        (b"\xff\xfe", "Invalid JSON"),
        (b"[]", "object"),
        (b'{"id": "request-1"}', "by"),
        (good + b" " * 20_000, "is the most"),
    ):
        ((accepted, content),) = query(peer, "recalibrate", payload, data_dir=gateway.data_dir)
        assert not accepted
        assert said in content["reason"], content
    assert query(peer, "recalibrate", good, "plumbline/v1/*/*/*") == []  # a request goes to one gateway
    peer.session.put("plumbline/v1/demo-site/crane-1/hook-1/load", b'{"loaded": true}')
    ((accepted, content),) = query(peer, "recalibrate", good, data_dir=gateway.data_dir)
    assert not accepted
    assert "a load hangs" in content["reason"]
    ((_, status),) = query(peer, "status", None)
    assert status["calibration"]["session"]["phase"] == "idle"
    assert gateway.process.poll() is None


def test_ctrl_c_leaves_the_session_running(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    command = [*REMOTE, "recalibrate", "--connect", gateway.endpoint]
    follower = subprocess.Popen(
        [*command, "--by", "ann", "--housing-off-rope"], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert "recalibrate: collecting" in present(follower.stdout).readline()
    assert "poses" in present(follower.stdout).readline()
    follower.send_signal(signal.SIGINT)
    out, _ = follower.communicate(timeout=PATIENCE_S)
    assert "the session continues" in out
    again = subprocess.Popen([*command, "--follow"], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert "0 of 6 poses" in present(again.stdout).readline()
    ((accepted, _),) = query(peer, "cancel", b'{"id": "request-1", "by": "bob"}', data_dir=gateway.data_dir)
    assert accepted
    out, _ = again.communicate(timeout=PATIENCE_S)
    assert "rejected: cancelled by bob" in out
    assert again.returncode == 1


class Line:
    """A line between the office and the gateway that can be cut and mended."""

    def __init__(self, endpoint: str) -> None:
        self._target = ("127.0.0.1", int(endpoint.rsplit(":", 1)[1]))
        self._sockets: list[socket.socket] = []
        self._cut = threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                office, _ = self._server.accept()
                if self._cut.is_set():
                    office.close()
                    continue
                gateway = socket.create_connection(self._target)
                self._sockets += [office, gateway]
                for pair in ((office, gateway), (gateway, office)):
                    self._threads.append(threading.Thread(target=self._carry, args=pair))
                    self._threads[-1].start()

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                target.sendall(data)

    def cut(self) -> None:
        self._cut.set()
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def mend(self) -> None:
        self._cut.clear()

    def close(self) -> None:
        self.cut()
        self._server.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for one in (self._server, *self._sockets):
            one.close()


def test_the_display_survives_a_lost_connection(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    line = Line(gateway.endpoint)
    try:
        follower = subprocess.Popen(
            [*REMOTE, "recalibrate", "--by", "ann", "--housing-off-rope", "--connect", line.endpoint],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert "recalibrate: collecting" in present(follower.stdout).readline()
        assert "poses" in present(follower.stdout).readline()
        line.cut()
        while "no answer from the gateway" not in (said := present(follower.stdout).readline()):
            assert said
        ((accepted, _),) = query(peer, "cancel", b'{"id": "request-1", "by": "bob"}', data_dir=gateway.data_dir)
        assert accepted
        line.mend()
        out, _ = follower.communicate(timeout=PATIENCE_S)
        assert "rejected: cancelled by bob" in out
        assert follower.returncode == 1
    finally:
        line.close()


def test_a_damaged_store_leaves_the_device_uncalibrated(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    folder = tmp_path / "data" / "calibration" / "simulated-1"
    folder.mkdir(parents=True)
    (folder / "in_force.json").write_text('{"format": 1')
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    ((_, status),) = query(peer, "status", None)
    message = status["calibration"]
    assert message["status"] == "uncalibrated"
    assert message["calibration_id"] is None
    assert "in_force.json" in message["text"]


def test_zero_in_place_while_the_load_hangs_still(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path, plumbline: Plumbline
) -> None:
    """A recording of a load at rest, leaning by what the mount is off, played ten times as fast."""
    rate_hz, lean_rad = 50, np.radians(1.5)
    random = np.random.default_rng(4)
    up = np.array([np.sin(lean_rad), 0.0, np.cos(lean_rad)])
    counts = np.rint(2048 * (up + random.normal(0, NOISE_G, (rate_hz * 400, 3)))).astype(int)
    path = tmp_path / "hanging.csv"
    path.write_text("x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in counts.tolist()))
    layout = TableLayout(axes=("x", "y", "z"), unit="counts", rate_hz=rate_hz, units_per_g=2048)
    device_id = table_info(path, read_table(path, layout), units_per_g=2048).device_id
    covariance = np.diag([1e-14] * 9 + [0.01] * 3).tolist()
    parent = add_content_hash(
        {
            "format": 1,
            "device_id": device_id,
            "method": "bench",
            "created_utc": "2026-01-01T00:00:00Z",
            "software": "test",
            "by": "bench",
            "parent": None,
            "unit": "counts",
            "offset": [0, 0, 0],
            "correction_matrix": (np.eye(3) / 2048).tolist(),
            "covariance": covariance,
            "prediction_interval_g": 0.01,
            "temperature_c": None,
        }
    )
    store = CalibrationStore(tmp_path / "data", device_id)
    store.add(parent)
    store.put_in_force(parent.id, by="bench", reason="", request="bench", time_utc="2026-01-01T00:00:00Z")
    gateway = start_gateway(
        f'[device]\nkind = "replay"\npath = "{path}"\nspeed = 10\naxis_columns = ["x", "y", "z"]\nunit = "counts"\n'
        f"units_per_g = 2048\nrate_hz = {rate_hz}\n[housing]\nposition_m = 5\n"
    )
    peer = join_bus(gateway.endpoint)
    peer.wait_for("tilt", lambda tilt: tilt["axial_deg"] == pytest.approx(1.5, abs=0.1))
    zero = ("remote", "zero", "--by", "ann", "--connect", gateway.endpoint)
    deadline = time.monotonic() + PATIENCE_S
    while (done := plumbline(*zero)).returncode == 1 and time.monotonic() < deadline:
        assert "static for" in done.stderr
    assert done.returncode == 0, done.stderr
    message = peer.wait_for("calibration", lambda message: message["calibration_id"] not in (None, parent.id))
    assert (message["record"]["method"], message["record"]["parent"]) == ("zero", parent.id)
    new_id = message["calibration_id"]
    tilt = peer.wait_for("tilt", lambda tilt: tilt["calibration_id"] == new_id and tilt["trusted"])
    assert tilt["axial_deg"] < 0.1
