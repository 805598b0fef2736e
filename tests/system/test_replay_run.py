"""Recordings through the whole gateway: tilt, conditions and a recording come out of them."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.recording.reading.recording_file import open_recording
from gateway.recording.reading.samples import read_samples
from gateway.topics import TOPICS
from tests.gateway.recording.recorded_files import summarise
from tests.system.conftest import StartGateway, run_process

pytestmark = pytest.mark.slow

REAL = Path(__file__).parents[1] / "data" / "real"
AT_ONCE = '[device]\nkind = "replay"\nspeed = 0\n'
SIX_POSITIONS = (
    AT_ONCE + f'path = "{REAL / "six_position_session.csv"}"\n'
    'axis_columns = ["acc_x", "acc_y", "acc_z"]\nunit = "counts"\nunits_per_g = 2048\nrate_hz = 10\nblock_samples = 1\n'
)
EXPECTED_LINES = ("INFO plumbline.alert: ", "WARNING plumbline.alert: ", "INFO plumbline.device: ")
PHONE = 'time_column = "1"\naxis_columns = ["2", "3", "4"]\nunit = "m/s2"\n'


def messages(path: Path, topic: str) -> list[Any]:
    file = open_recording(path)
    return [file.decode(message) for message in file.messages() if message.topic == f"/{topic}"]


def replayed(start_gateway: StartGateway, toml: str) -> Path:
    gateway = start_gateway(toml)
    code, _, err = gateway.wait()
    assert code == 0
    assert [line for line in err.splitlines() if not line.startswith(EXPECTED_LINES)] == []
    path: Path
    (path,) = gateway.recordings
    return path


def test_six_position_session_reads_its_labels(start_gateway: StartGateway) -> None:
    """Faces last five seconds each; the second half of each is past the low-pass's transient."""
    path = replayed(start_gateway, SIX_POSITIONS)
    assert summarise(path).samples.count == 300
    labels = [line.split(",")[0] for line in (REAL / "six_position_session.csv").read_text().splitlines()[1:]]
    tilts = messages(path, "tilt")
    assert [tilt.sequence for tilt in tilts] == list(range(0, 300, TOPICS["tilt"].recorded_every))
    expected = {"x_p": (90, None), "x_a": (-90, None), "y_p": (None, 90), "y_a": (None, -90)}
    for tilt in tilts:
        index, label = tilt.sequence, labels[tilt.sequence]
        if index % 50 < 30:
            continue
        if label in expected:
            pitch_deg, roll_deg = expected[label]
            found_deg = tilt.pitch_deg if pitch_deg is not None else tilt.roll_deg
            assert found_deg == pytest.approx(pitch_deg or roll_deg, abs=4), (index, label)
        else:
            assert tilt.axial_deg == pytest.approx(0 if label == "z_p" else 180, abs=6), (index, label)
    assert {message.calibration for message in messages(path, "condition")} == {"uncalibrated"}


def test_phone_at_rest_is_still_and_leans_a_little(start_gateway: StartGateway) -> None:
    path = replayed(start_gateway, AT_ONCE + f'path = "{REAL / "phone_at_rest.txt"}"\n' + PHONE)
    last = messages(path, "tilt")[-1]
    rows = np.loadtxt(REAL / "phone_at_rest.txt")[:, 1:4]
    mean = rows.mean(axis=0)
    assert last.axial_deg == pytest.approx(math.degrees(math.atan2(math.hypot(*mean[:2]), mean[2])), abs=0.2)
    assert {message.verdict for message in messages(path, "condition")} <= {"unknown", "static", "quasi_static"}


def test_a_falling_phone_is_never_trusted(start_gateway: StartGateway) -> None:
    """In free fall the specific force vanishes, and the impact is far beyond 1 g: no angle of that may look right."""
    path = replayed(start_gateway, AT_ONCE + f'path = "{REAL / "phone_falling.txt"}"\n' + PHONE)
    conditions = messages(path, "condition")
    falling = [message for message in conditions if message.norm_g is not None and abs(message.norm_g - 1) > 0.2]
    assert all(message.verdict in ("disturbed", "unknown") and not message.trusted for message in falling)
    assert "disturbed" in {message.verdict for message in conditions}
    assert all(message.coverage95_deg is None for message in messages(path, "swing"))


def test_a_recording_of_the_gateway_replays_to_the_same_numbers(start_gateway: StartGateway, tmp_path: Path) -> None:
    first = start_gateway("[device]\nblock_samples = 8\n", arguments=("--duration", "14"))
    code, _, said = first.wait()
    assert code == 0, said
    (path,) = first.recordings
    moved = tmp_path / "first.mcap"
    path.rename(moved)
    again = replayed(
        start_gateway,
        AT_ONCE + f'path = "{moved}"\nblock_samples = 8\n[housing]\nabove_load_m = 3.0\n',
    )
    assert np.array_equal(read_samples([again]).samples.time_ns, read_samples([moved]).samples.time_ns)
    for topic in ("tilt", "swing"):
        live, replay = (
            [json.dumps(_numbers(message)) for message in messages(recording, topic)] for recording in (moved, again)
        )
        assert len(live) > 3
        assert live == replay, topic


def _numbers(message: Any) -> list[object]:
    """What was computed, without the header's clock."""
    return [value for name, value in asdict(message).items() if name not in ("time_ns", "clock")]


def test_a_recording_of_a_phone_is_played_by_options_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The columns of `phone_at_rest.txt` have no names."""
    monkeypatch.setenv("PLUMBLINE_BUS__LISTEN", "[]")
    monkeypatch.setenv("PLUMBLINE_PAGE__ENABLED", "false")
    monkeypatch.setenv("PLUMBLINE_GATEWAY__DATA_DIR", str(tmp_path / "data"))
    done = run_process("run", "--replay", REAL / "phone_at_rest.txt", "--speed", "0", "--unit", "m/s2")
    assert done.returncode == 0, done.stderr
    assert "axes x, y, z: columns 2, 3, 4; column 1: time in s" in done.stderr
    (path,) = (tmp_path / "data").rglob("*.mcap")
    assert summarise(path).samples.count == 200


def test_options_of_a_recording_want_one() -> None:
    done = run_process("run", "--unit", "g")
    assert done.returncode == 2
    assert "describe the recording of --replay LOG" in done.stderr


def table_at_once(folder: Path) -> str:
    """A configuration that plays 60 blocks of ten samples as fast as possible."""
    table = folder / "log.csv"
    table.write_text("time_s,ax_g,ay_g,az_g\n" + "".join(f"{n / 100},0.01,0,1\n" for n in range(600)))
    return AT_ONCE + f'path = "{table}"\nblock_samples = 10\n'


def test_a_processor_that_is_slow_yet_progresses_is_waited_for(start_gateway: StartGateway, tmp_path: Path) -> None:
    gateway = start_gateway(table_at_once(tmp_path), program=("tests.system.slow_processor", "0.1", "0"))
    code, _, err = gateway.wait()
    assert code == 0, err
    assert "ended without" not in err
    (path,) = gateway.recordings
    assert summarise(path).samples.count == 600


def test_a_processor_that_hangs_leaves_losses(start_gateway: StartGateway, tmp_path: Path) -> None:
    gateway = start_gateway(table_at_once(tmp_path), program=("tests.system.slow_processor", "0", "20"))
    code, _, err = gateway.wait()
    assert code == 3
    assert "ended without processor, which did not stop in time" in err
    assert "samples that waited in a queue could not be recorded" in err
    (path,) = gateway.recordings
    assert summarise(path).samples.count == 190


def test_a_recording_of_long_ago_that_is_played_in_its_own_time_is_not_stale(
    start_gateway: StartGateway, tmp_path: Path
) -> None:
    """Its blocks are 0.26 s apart: what is between them is no silence of the sensor, however long ago they were recorded."""
    source = tmp_path / "swing.mcap"
    rig = tmp_path / "rig.toml"
    rig.write_text("[rope]\nlength_m = 12.0\n[housing]\nposition_m = 9.0\n")
    assert run_process("simulate", rig, "--duration", "6", "--out", source).returncode == 0
    path = replayed(start_gateway, f'[device]\nkind = "replay"\nspeed = 1\npath = "{source}"\n')
    validity = [each.validity for each in messages(path, "alert")]
    first = next(
        place for place, each in enumerate(validity) if each != "no_samples"
    )  # before the first block there is none
    assert len(validity) - first > 3
    assert "no_samples" not in validity[first:]
