"""Replay of recordings whose beginning or end is missing: what cannot be computed again is no difference, nor equal."""

from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recording.replay import replay_run as replay_result
from tests.clocks import START_NS
from tests.gateway.recorded_crane import HastyCrane
from tests.gateway.recording.recorded_crane import BOOT_ID, RecordedCrane
from tests.gateway.recording.replaying import replay
from tests.gateway.restarted_crane import KilledCrane


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
