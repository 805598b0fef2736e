import hashlib
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.device import Device, EndOfRecording
from devices.errors import RecordingError
from devices.recording import Recording
from devices.tables.layout import NATIVE, TableLayout
from devices.tables.native import read_table
from devices.tables.replay import Replay, table_info
from tests.clocks import START_NS, SleeplessClock
from tests.devices.tables.table_lines import REAL, SIX_POSITION
from tests.values import present

INFO = DeviceInfo(kind="replay", device_id="recording-test", unit="g", odr_hz=50, units_per_g=1)


def replay_table(
    path: Path,
    layout: TableLayout = NATIVE,
    *,
    units_per_g: float | None = None,
    speed: float = 1.0,
    block_samples: int = 32,
) -> Replay:
    recording = read_table(path, layout)
    info = table_info(path, recording, units_per_g=units_per_g, housing_frame=layout is NATIVE)
    return Replay([recording], info, clock=SleeplessClock(), speed=speed, block_samples=block_samples)


def recording_at(time_s: list[float], **facts: Any) -> Recording:
    n = len(time_s)
    given: dict[str, Any] = {
        "unit": "g",
        "lost_before": np.zeros(n, np.int64),
        "unusable_before": np.zeros(n, np.int64),
    } | facts
    raw = np.column_stack([np.arange(n), np.zeros(n), np.ones(n)]).astype(float)
    return Recording(time_s=np.array(time_s), raw=given.pop("raw", raw), **given)


def even(count: int) -> list[float]:
    return [0.02 * number for number in range(count)]


def play(device: Device) -> list[SampleBlock]:
    blocks: list[SampleBlock] = []
    while True:
        try:
            block = device.read()
        except EndOfRecording:
            return blocks
        if block is not None:
            blocks.append(block)


def test_a_replay_at_full_speed_returns_complete_blocks() -> None:
    clock = SleeplessClock()
    for speed in (0, math.inf):
        device = Replay([recording_at(even(70))], INFO, clock=clock, speed=speed, block_samples=32)
        assert device.open() is INFO
        blocks = play(device)
        assert [len(block) for block in blocks] == [32, 32, 6]
        assert clock.slept_s == []
        time_ns = np.concatenate([block.time_ns for block in blocks])
        np.testing.assert_array_equal(time_ns, START_NS + 20_000_000 * np.arange(70))
        assert np.concatenate([block.raw for block in blocks])[:, 0].tolist() == list(range(70))


@pytest.mark.parametrize("speed", [0.5, 1, 8])
def test_blocks_come_when_their_last_sample_is_due(speed: float) -> None:
    clock = SleeplessClock()
    device = Replay([recording_at(even(40))], INFO, clock=clock, speed=speed, block_samples=10)
    device.open()
    for number in range(1, 5):
        while device.read() is None:
            pass
        assert clock.ns - START_NS == pytest.approx((10 * number - 1) * 20e6 / speed, abs=2)
    assert max(clock.slept_s) <= 0.5
    with pytest.raises(EndOfRecording):
        device.read()


def test_read_waits_through_a_long_gap_in_half_seconds() -> None:
    clock = SleeplessClock()
    device = Replay([recording_at([0, 0.02, 3.0, 3.02])], INFO, clock=clock, block_samples=2)
    device.open()
    reads = [device.read() for _ in range(7)]
    assert [None if block is None else len(block) for block in reads] == [2, None, None, None, None, None, 2]


def test_late_blocks_are_returned_at_once() -> None:
    clock = SleeplessClock()
    device = Replay([recording_at(even(100))], INFO, clock=clock, block_samples=10)
    device.open()
    clock.ns += 1_000_000_000
    assert [len(present(device.read())) for _ in range(5)] == [10] * 5
    assert clock.slept_s == []


def test_gaps_are_between_blocks_and_counted() -> None:
    lost = np.zeros(20, np.int64)
    lost[[5, 12]] = [3, 7]
    unusable = np.zeros(20, np.int64)
    unusable[[2, 9, 19]] = [1, 2, 4]
    device = Replay(
        [recording_at(even(20), lost_before=lost, unusable_before=unusable)],
        INFO,
        clock=SleeplessClock(),
        speed=0,
        block_samples=6,
    )
    device.open()
    told = [(len(block), block.lost, block.invalid) for block in play(device)]
    assert told == [(5, 0, 1), (6, 3, 2), (1, 0, 0), (6, 7, 0), (2, 0, 4)]


def test_a_gap_of_unusable_rows_separates_blocks() -> None:
    time_s = [*even(5), *(0.2 + time for time in even(5))]
    device = Replay([recording_at(time_s)], INFO, clock=SleeplessClock(), speed=0)
    device.open()
    assert [len(block) for block in play(device)] == [5, 5]


def test_counts_are_integers() -> None:
    raw = np.array([[2**31 - 1, -(2**31) + 1, 0], [1, -2, 3]], dtype=float)
    device = Replay(
        [recording_at([0, 1], raw=raw, unit="counts")], replace(INFO, unit="counts"), clock=SleeplessClock(), speed=0
    )
    device.open()
    block = present(device.read())
    assert block.raw.dtype == np.int32
    np.testing.assert_array_equal(block.raw, raw)


def test_the_temperature_of_a_block_is_the_mean_of_the_known_ones() -> None:
    temperature = np.array([20, np.nan, 22, np.nan, np.nan, np.nan])
    recording = recording_at(even(6), temperature_c=temperature)
    device = Replay([recording], INFO, clock=SleeplessClock(), speed=0, block_samples=3)
    device.open()
    assert [block.temperature_c for block in play(device)] == [21, None]


@pytest.mark.parametrize("cuts", [(2,), (7, 9, 30), (32, 64)])
def test_parts_are_played_as_the_whole_recording(cuts: tuple[int, ...]) -> None:
    """Blocks do not end with a part, gaps are kept, and a part without temperatures changes nothing else."""
    time_s = [*even(50), *(5 + time for time in even(30))]
    lost = np.zeros(80, np.int64)
    lost[[20, 50]] = [1, 200]
    whole = recording_at(time_s, lost_before=lost, temperature_c=np.arange(80.0), origin_ns=START_NS, repeated=3)
    limits = [0, *cuts, 80]
    parts = [whole.part(begin, end) for begin, end in pairwise(limits)]
    for part, begin in zip(parts, limits, strict=False):
        part.lost_before[0] = lost[begin]
    played = []
    for recordings in ([whole], [replace(part, repeated=1 if place < 3 else 0) for place, part in enumerate(parts)]):
        device = Replay(recordings, INFO, clock=SleeplessClock(), speed=0)
        device.open()
        played.append(play(device))
    assert [len(block) for block in played[0]] == [len(block) for block in played[1]]
    for expected, found in zip(*played, strict=True):
        np.testing.assert_array_equal(found.time_ns, expected.time_ns)
        np.testing.assert_array_equal(found.raw, expected.raw)
        assert (found.lost, found.temperature_c) == (expected.lost, expected.temperature_c)


def test_rows_left_out_are_counted_once_however_often_a_replay_begins() -> None:
    parts = [recording_at(even(3), repeated=1), recording_at([1 + time for time in even(3)], repeated=2)]
    device = Replay(parts, INFO, clock=SleeplessClock(), speed=0)
    for _ in range(2):
        device.open()
        play(device)
        assert device.faults["repeated"] == 3


def test_absolute_times_are_kept_to_the_nanosecond() -> None:
    offsets_ns = np.array([0, 1, 3, 40_000_000_123_456, 86_400_000_000_001])
    recording = recording_at((offsets_ns / 1e9).tolist(), origin_ns=1_600_000_000_123_456_789)
    device = Replay([recording], INFO, clock=SleeplessClock(), speed=0)
    device.open()
    time_ns = np.concatenate([block.time_ns for block in play(device)])
    np.testing.assert_array_equal(time_ns, 1_600_000_000_123_456_789 + offsets_ns)


def test_a_replay_restarts_at_open_and_ends_at_close() -> None:
    clock = SleeplessClock()
    device = Replay([recording_at(even(3))], INFO, clock=clock, speed=0)
    device.open()
    assert len(play(device)) == 1
    device.close()
    device.close()
    clock.ns += 5_000_000_000
    device.open()
    assert present(device.read()).time_ns[0] == START_NS + 5_000_000_000
    device.close()
    with pytest.raises(EndOfRecording):
        device.read()


@pytest.mark.parametrize("wrong", [{"speed": -1}, {"speed": math.nan}, {"block_samples": 0}])
def test_impossible_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="impossible: give"):
        Replay([recording_at(even(3))], INFO, clock=SleeplessClock(), **wrong)


@pytest.mark.parametrize("time_s", [[0], [0, 1, 1], [0, 2, 1], [0, 1e-10]])
def test_a_recording_with_decreasing_times_is_refused(time_s: list[float]) -> None:
    with pytest.raises(ValueError, match="recording"):
        recording_at(time_s)


def test_a_table_with_faults_is_replayed(tmp_path: Path) -> None:
    lines = [f"{0.02 * number:.2f},0.0,0.0,1.0,{20 + number}" for number in range(12)]
    lines[3], lines[4] = "", "0.08,nan,0.0,1.0,20"
    del lines[7]
    path = tmp_path / "crane 7.csv"
    path.write_text("\n".join(["time_s,ax_g,ay_g,az_g,temperature_c", *lines, "0.22,0.0,0.0,1.0,20", "0.2"]))
    device = replay_table(path, speed=0)
    info = device.open()
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert info.device_id == f"recording-crane 7-{digest[:8]}"
    assert info.kind == "replay"
    assert (info.unit, info.units_per_g, info.odr_hz) == ("g", 1, 50)
    assert info.calibrated_source
    assert info.can_wait
    blocks = play(device)
    assert [(len(block), block.lost, block.invalid) for block in blocks] == [(3, 0, 0), (2, 1, 1), (4, 1, 1)]
    assert [block.temperature_c for block in blocks] == [21, 25.5, 29.5]
    assert dict(device.faults) == {"repeated": 1, "backward": 0, "invalid": 1, "blank": 1, "truncated": 1}


def test_another_recording_is_another_device(tmp_path: Path) -> None:
    ids = set()
    for number, reading in enumerate(("0.1", "0.2")):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = folder / "log.csv"
        path.write_text(f"time_s,ax_g,ay_g,az_g\n0,{reading},0,1\n1,0,0,1\n")
        ids.add(replay_table(path).open().device_id)
    assert len(ids) == 2


def test_real_six_position_session_in_counts() -> None:
    device = replay_table(REAL / "six_position_session.csv", SIX_POSITION, units_per_g=2048, speed=0, block_samples=50)
    info = device.open()
    assert (info.unit, info.units_per_g, info.odr_hz) == ("counts", 2048, 204.8)
    assert not info.calibrated_source
    blocks = play(device)
    assert [block.raw.dtype for block in blocks] == [np.int32] * 6
    upward = [int(np.abs(block.raw.mean(axis=0)).argmax()) for block in blocks]
    assert upward == [0, 0, 1, 1, 2, 2]


def test_counts_need_a_sensitivity() -> None:
    with pytest.raises(RecordingError, match=r"six_position_session\.csv: .*how many counts are 1 g"):
        replay_table(REAL / "six_position_session.csv", SIX_POSITION)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone\.csv: no such file"):
        replay_table(tmp_path / "gone.csv", NATIVE)
