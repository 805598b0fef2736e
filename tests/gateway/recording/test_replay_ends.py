"""Replay of recordings whose beginning or end is missing: what cannot be computed again is no difference, nor equal."""

import re
from pathlib import Path

import pytest
from mcap.reader import make_reader

from devices.simulated.device import SimulatedCrane
from gateway.cli.main import main
from gateway.incident.incident_selection import read_incidents
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recording.format import mcap_writer
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.replay import replay_run as replay_result
from gateway.recording.segments.compaction import compact
from tests.clocks import START_NS, SleeplessClock
from tests.gateway.recorded_crane import HastyCrane
from tests.gateway.recording.recorded_crane import BOOT_ID, RecordedCrane
from tests.gateway.recording.replaying import replay
from tests.gateway.restarted_crane import KilledCrane
from tests.values import present


def record_without_beginning(folder: Path, duration_s: float) -> None:
    """Record, and take the first segment away."""
    crane = RecordedCrane(folder)
    crane.record(duration_s)
    crane.close()
    sorted(folder.glob("*.mcap"))[0].unlink()


@pytest.fixture(scope="module")
def headless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """45 s without the first 20."""
    folder = tmp_path_factory.mktemp("headless")
    record_without_beginning(folder, 45)
    return folder


@pytest.mark.slow
def test_part_without_the_start_of_its_run_is_compared_after_a_warm_up(
    headless: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_result, "WARM_UP_NS", 15 * 10**9)
    code, result = replay(headless, capsys)
    assert (code, result["differing"]) == (0, {})
    (note,) = result["notes"]
    assert note.startswith(
        "201 blocks of the run are not in these files, or cannot be read: compared from 2026-01-01T00:00:35"
    )
    assert set(result["compared"]) == {"/acceleration", "/tilt"}
    assert 15 < result["compared"]["/tilt"] < 25
    assert {"largest angle", "swing unknown"} <= {row["quantity"] for row in result["table"]}


def test_too_short_a_part_is_not_said_to_be_equal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record_without_beginning(tmp_path, 25)
    code, result = replay(tmp_path, capsys)
    assert (code, result["equal"], result["is_compared"], result["compared"]) == (3, False, False, {})
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("nothing could be compared: without the start of a run its first 120 s say nothing")


@pytest.mark.slow
def test_what_a_cold_start_cannot_compute_again_is_not_called_a_difference(
    headless: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_result, "WARM_UP_NS", 5 * 10**9)
    assert main(["record", "replay", str(headless)]) == 0
    printed = capsys.readouterr().out
    assert "? may come from the start alone" in printed
    assert "\n* " not in printed


@pytest.mark.slow
def test_what_a_kill_has_cut_off_before_a_restart_is_no_difference(
    restarted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, result = replay(restarted, capsys)
    assert (code, result["differing"]) == (0, {})
    assert result["cut_off"] == {"/acceleration": 1, "/alert": 1, "/condition": 1, "/motion": 1, "/tilt": 1}
    assert "5 at the end of the last file, or of one that was cut off, are not recorded" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("is_followed", [True, False])
def test_a_last_block_whose_results_were_to_follow_in_the_next_segment_is_no_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], *, is_followed: bool
) -> None:
    """Killed just after a new segment has begun, which has a line of the log alone, or the first files of a run alone."""
    crane = KilledCrane(tmp_path)
    crane.is_closed, crane.last_ns = True, START_NS + 7_000_000_000
    crane.record(8.0)
    if is_followed:
        killed = HastyCrane(tmp_path, BOOT_ID, START_NS + 8_000_000_000)
        killed.log("about to be killed", START_NS + 8_000_000_000, "plumbline")
        killed.recorder.tick(START_NS + 10_000_000_000)
        killed.recorder.abandon("killed")
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
    assert {"/motion", "/tilt"} <= result["cut_off"].keys()


class ForgetfulKilledCrane(KilledCrane):
    """Leaves out a condition two seconds before it is killed."""

    def write(self, message: OutgoingMessage) -> None:
        time_ns = message.log_time_ns
        if message.topic != "condition" or not START_NS + 4_900_000_000 <= time_ns < START_NS + 5_400_000_000:
            super().write(message)


@pytest.mark.slow
@pytest.mark.parametrize("crane", [KilledCrane, ForgetfulKilledCrane])
@pytest.mark.parametrize("is_killed", [True, False])
def test_what_is_missing_elsewhere_is_a_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], crane: type[KilledCrane], *, is_killed: bool
) -> None:
    """A recording that was closed has no end that was cut off."""
    killed = crane(tmp_path)
    killed.last_ns = START_NS + 7_000_000_000
    killed.is_closed = not is_killed
    killed.record(8.0)
    following = HastyCrane(tmp_path, "b002", START_NS + 12_000_000_000)
    following.record(2.0)
    following.close()
    code, result = replay(tmp_path, capsys)
    forgotten = {"/condition"} if crane is ForgetfulKilledCrane else set()
    last = set() if is_killed else {"/motion", "/tilt"}
    assert (code, set(result["differing"]) >= forgotten | last) == (int(bool(forgotten | last)), True)
    assert is_killed or not result["cut_off"]


def flip_bit(path: Path, place: int) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """20 s and 10 s later again, in chunks of some seconds that end anywhere among the messages that follow from a block."""
    folder = tmp_path_factory.mktemp("two runs")
    for boot_id, start_ns in ((BOOT_ID, START_NS), ("b002", START_NS + 30_000_000_000)):
        device = SimulatedCrane(
            odr_hz=100, block_samples=10, length_m=12.0, position_m=9.0, clock=SleeplessClock(start_ns)
        )
        crane = RecordedCrane(folder, 60.0, device=device, boot_id=boot_id, start_ns=start_ns)
        crane.record(20)
        crane.close()
    paths = sorted(folder.glob("*.mcap"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap_writer, "CHUNK_BYTES", 40_001)
        for path in paths:
            compact(path)
    return paths


def copy_with_a_flipped_bit(paths: list[Path], folder: Path, place: int) -> Path:
    for path in paths:
        (folder / path.name).write_bytes(path.read_bytes())
    flip_bit(folder / paths[0].name, place)
    return folder


@pytest.mark.parametrize("number", [1, 2, 3])
def test_what_is_beside_a_hole_is_no_difference_and_what_is_before_it_and_of_other_runs_is_compared(
    two_runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], number: int
) -> None:
    with two_runs[0].open("rb") as file:
        chunk = present(make_reader(file).get_summary()).chunk_indexes[number]
    place = chunk.chunk_start_offset + chunk.chunk_length // 2
    code, result = replay(copy_with_a_flipped_bit(two_runs, tmp_path, place), capsys)
    assert (code, result["differing"], result["equal"]) == (3, {}, True)
    (note,) = result["notes"]
    assert ": compared up to 2026-01-01T00:00:" in note
    left = re.search(r", and nothing behind them: 120 s would be needed, (\d+\.\d) s are left$", note)
    assert 0.0 <= float(present(left)[1]) <= 20.0 - (chunk.message_end_time - START_NS) / 1e9 + 0.2
    before = (chunk.message_start_time - START_NS) / 1e8
    assert result["compared"]["/motion"] == pytest.approx(before + 200, abs=2)
    assert result["not_compared"]["/motion"] > 20
    assert "messages computed again, 0 differ (byte for byte)" in capsys.readouterr().out


def test_a_wrong_checksum_is_no_message_that_was_not_replayed(
    two_runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with two_runs[0].open("rb") as file:
        (index, *_) = present(make_reader(file).get_summary()).chunk_indexes[1].message_index_offsets.values()
    folder = copy_with_a_flipped_bit(two_runs, tmp_path, index + 30)
    code, result = replay(folder, capsys)
    assert (code, result["equal"], result["hidden"], result["compared"]["/motion"]) == (3, True, [], 400)
    (said,) = (line for line in capsys.readouterr().out.splitlines() if "CHECKSUM WRONG" in line)
    assert said == f"{two_runs[0].name}: CHECKSUM WRONG: the content was altered; every message in it could be read"
    hidden: list[str] = []
    read_incidents(open_timeline([folder]), hidden=hidden)
    assert hidden == []
