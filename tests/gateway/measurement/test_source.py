"""The input of `measure`: an interval of one file or of several files of a gateway, and a rig, which may state no rope length."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.errors import RecordingError
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from gateway import messages
from gateway.errors import InputError
from gateway.measurement.rig_file import read_rig_of_recording
from gateway.measurement.source import read_source
from gateway.messages.calibration import NO_SESSION
from gateway.packing import pack
from gateway.pipeline.outgoing_message import encode_message
from gateway.pipeline.rig import Rig, RigHousing, RigRope
from gateway.recording.format.content import RecordingHeader
from gateway.recording.reading.interval import RecordingInterval, parse_recording_time
from gateway.recording.reading.recording_file import EVERYTHING
from gateway.recording.reading.sample_calibration import CalibratedReader
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.recorder import Recorder
from tests.gateway.recording.recorded_crane import RecordedCrane, recalibrated
from tests.values import present

START_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00:00 UTC."""
RATE_HZ = 50.0
DEVICE = DeviceInfo(kind="replay", device_id="part-7", unit="g", odr_hz=RATE_HZ, units_per_g=1.0)
RIG = Rig(rope=RigRope(length_m=9.0), housing=RigHousing(position_m=4.0))
Write = Callable[..., Path]
LENGTH_M, POSITION_M = 3.0, 1.0
HOUSING = f"[housing]\nposition_m = {POSITION_M}\n"


def interval(begin: str | None = None, end: str | None = None) -> RecordingInterval:
    return RecordingInterval(*(None if text is None else parse_recording_time(text) for text in (begin, end)))


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a file of one block; its readings are the seconds from `START_NS`."""

    def write(
        name: str,
        begin_s: float,
        seconds: float,
        toml: str = "",
        wall_offset_ns: int = 0,
        calibrations: dict[float, str] | None = None,
        sessions: dict[float, str] | None = None,
        turned_s: tuple[float, float] = (0.0, 0.0),
    ) -> Path:
        """`calibrations`: texts by their times; `sessions`: who begins to recalibrate; empty: an end; `turned_s`: with -z up."""
        header = RecordingHeader("0.1.0", "yard", "crane-2", "hook", "b00t", toml)
        recorder = Recorder(tmp_path, header, segment_s=600.0, fsync_s=1.0, quota_mb=100.0)
        time_s = begin_s + np.arange(0, seconds, 1 / RATE_HZ)
        time_ns = START_NS + np.rint(time_s * 1e9).astype(np.int64)
        recorder.set_device(DEVICE, int(time_ns[0]))
        path = recorder.start(int(time_ns[0]))
        head: dict[str, Any] = {"time_ns": START_NS, "clock": "synchronised", "sequence": 0, "calibration_id": None}
        for at_s, text in (calibrations or {}).items():
            calibration = messages.Calibration(
                **head, status="factory", device_id="part-7", record={}, in_force={"text": text}, text=text
            )
            recorder.write(encode_message("calibration", calibration, START_NS + round(at_s * 1e9)))
        for at_s, by in (sessions or {}).items():
            session = replace(NO_SESSION, by=by, suspended=bool(by))
            calibration = messages.Calibration(
                **head, status="factory", device_id="part-7", record={}, in_force={}, text="", session=session
            )
            recorder.write(encode_message("calibration", calibration, START_NS + round(at_s * 1e9)))
        clock = messages.ClockOffset(**head, log_time_ns=START_NS, wall_offset_ns=wall_offset_ns, stepped=False)
        recorder.write(encode_message("clock", clock, int(time_ns[0])))
        readings_g = np.repeat(time_s[:, np.newaxis], 3, axis=1)
        readings_g[(time_s >= turned_s[0]) & (time_s < turned_s[1])] = [0.0, 0.0, -1.0]
        block = SampleBlock(time_ns, readings_g, lost=4)
        recorder.write(
            encode_message(
                "samples",
                pack(block, time_ns=int(time_ns[-1]), clock="synchronised", sequence=0, calibration_id=None),
                int(time_ns[-1]),
            )
        )
        recorder.close()
        return path.rename(tmp_path / name)

    return write


def test_interval_keeps_the_time_axis_of_the_whole_recording(write: Write) -> None:
    paths = [write("a.mcap", 0, 10), write("b.mcap", 12, 10)]
    source = read_source(paths, interval=interval("5", "00:00:15"))
    recording = source.recording
    np.testing.assert_allclose(recording.time_s[[0, -1]], [5.0, 14.98], rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.raw[:, 0], recording.time_s, rtol=0, atol=1e-9)
    assert source.force_g.shape == recording.raw.shape
    assert (recording.lost, recording.lost_before[0]) == (100, 0)
    assert source.files == tuple(paths)
    assert source.extent.last_s == pytest.approx(21.98)


def test_only_the_files_of_an_interval_are_read(write: Write) -> None:
    paths = [write("a.mcap", 0, 10), write("b.mcap", 30, 10), write("c.mcap", 60, 10)]
    whole, part = read_source(paths), read_source(paths, interval=interval("32", "38"))
    assert (len(whole.files), part.files) == (3, (paths[1],))
    assert part.extent == whole.extent
    kept = (whole.recording.time_s >= 32) & (whole.recording.time_s < 38)
    np.testing.assert_array_equal(part.recording.time_s, whole.recording.time_s[kept])
    np.testing.assert_array_equal(part.force_g, whole.force_g[kept])


def test_losses_before_the_first_sample_belong_to_the_whole_recording_alone(write: Write) -> None:
    path = write("a.mcap", 0, 10)
    assert read_source([path]).recording.lost == 4
    assert read_source([path], interval=interval("0", "5")).recording.lost == 4
    assert read_source([path], interval=interval("1", "5")).recording.lost == 0


def test_consecutive_intervals_share_no_sample(write: Write) -> None:
    path = write("a.mcap", 0, 10)
    parts = [read_source([path], interval=interval(*limits)) for limits in ((None, "4"), ("4", None))]
    assert [len(part.recording) for part in parts] == [200, 300]


def test_utc_is_that_of_the_corrected_wall_clock(write: Write) -> None:
    path = write("a.mcap", 0, 10, wall_offset_ns=3_600_000_000_000)
    source = read_source([path], interval=interval("2026-01-01T01:00:04Z"))
    assert source.recording.time_s[0] == pytest.approx(4.0)


def test_an_interval_with_fewer_than_two_samples_is_refused(write: Write) -> None:
    paths = [write("a.mcap", 0, 10), write("b.mcap", 12, 10)]
    with pytest.raises(InputError, match=r"fewer than two samples; the recording is 0 to 21\.980 s, 2026-01-01T"):
        read_source(paths, interval=interval("10.5", "11.5"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tomls", "setting"),
    [
        (("[device]\naxes_map = 'y,-x,z'\n", ""), "device.axes_map"),
        (("[rope]\nlength_m = 9.0\n", "[rope]\nlength_m = 8.0\n"), "rope.length_m"),
        (("[housing]\nposition_m = 4.0\n", "[housing]\nposition_m = 5.0\n"), "position of the housing"),
        (("[site]\ngravity_m_s2 = 9.81\n", ""), "gravity"),
    ],
)
def test_files_with_different_settings_are_refused(write: Write, tomls: tuple[str, str], setting: str) -> None:
    paths = [write(f"{place}.mcap", 20 * place, 10, toml) for place, toml in enumerate(tomls)]
    with pytest.raises(RecordingError, match=rf"1\.mcap: was recorded with another {setting} than .*0\.mcap"):
        read_source(paths)


def test_a_rig_replaces_different_ropes_but_not_different_axes(write: Write) -> None:
    tomls = ["[rope]\nlength_m = 9.0\n", "[rope]\nlength_m = 8.0\n"]
    paths = [write(f"{place}.mcap", 20 * place, 10, toml) for place, toml in enumerate(tomls)]
    housing = read_source(paths, RIG).housing
    assert housing is not None
    assert housing.length_m == 9.0
    paths.append(write("2.mcap", 40, 10, "[device]\naxes_map = 'y,-x,z'\n"))
    with pytest.raises(RecordingError, match=r"another device\.axes_map"):
        read_source(paths, RIG)


@pytest.fixture(scope="module")
def recalibrated_crane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 s by the factory's record, 3 s of a recalibration, and 15 s by its record."""
    folder = tmp_path_factory.mktemp("recalibrated")
    recalibrated(RecordedCrane(folder))
    return folder


@pytest.mark.parametrize(
    ("begin", "end", "ids"), [(None, None, ["factory-simulated-1-2g", "site-2"]), ("16", None, ["site-2"])]
)
def test_each_part_is_read_by_the_calibration_that_was_in_force(
    recalibrated_crane: Path, begin: str | None, end: str | None, ids: list[str]
) -> None:
    """As `record export` and the report of an incident read it."""
    source = read_source([recalibrated_crane], interval=interval(begin, end))
    blocks = list(CalibratedReader(open_timeline([recalibrated_crane]), EVERYTHING).blocks())
    time_ns = np.concatenate([each.block.time_ns for each in blocks])
    kept = np.searchsorted(time_ns, present(source.recording.origin_ns) + np.rint(1e9 * source.recording.time_s))
    force_g = np.concatenate([each.force_g for each in blocks])
    np.testing.assert_allclose(source.force_g, force_g[kept], rtol=0, atol=1e-12)
    assert [text.split(",")[0].split()[-1] for text in source.calibration.split("; then ")] == ids
    used = {each.correction.text: each.correction for each in blocks}
    largest_u_g = np.max([used[text].u_zero_g_offset_g for text in source.calibration.split("; then ")], axis=0)
    assert (present(source.correction).u_zero_g_offset_g >= largest_u_g).all()
    changes = [text for text in source.remarks if text.startswith("another calibration")]
    assert len(changes) == len(ids) - 1
    assert all(re.fullmatch(r".* at 1[45]\.\d{3} s; each part is judged by its own", text) for text in changes)


def test_a_calibration_that_is_stated_again_is_no_other_one(write: Write) -> None:
    path = write("a.mcap", 0, 10, calibrations={0.0: "old", 6.0: "new"})
    assert read_source([path]).remarks == ()


def test_readings_of_a_housing_off_the_rope_are_not_judged(write: Write) -> None:
    path = write("a.mcap", 0, 10, sessions={0.0: "", 3.0: "Carla", 6.0: "", 8.0: "Dan"})
    source = read_source([path])
    seconds = np.unique(np.floor(source.recording.time_s + 1e-9)).tolist()
    assert seconds == [0, 1, 2, 6, 7]
    assert len(source.force_g) == len(source.recording) == 5 * RATE_HZ
    assert source.remarks == (
        "from 3.0 s to 6.0 s the sensor was being recalibrated by Carla; not judged",
        "from 8.0 s on the sensor was being recalibrated by Dan; not judged",
    )
    with pytest.raises(InputError, match="by Carla, and no reading describes the load; choose another time"):
        read_source([path], interval=interval("4", "5"))
    assert read_source([path], interval=interval("6", "8")).remarks == ()


@pytest.mark.parametrize("begin_s", [0.0, 2.0, 3.2])
def test_a_pose_in_which_a_recalibration_ends_is_left_out_with_it(write: Write, begin_s: float) -> None:
    path = write("a.mcap", 0, 10, sessions={0.0: "", 1.0: "Carla", 3.0: ""}, turned_s=(2.5, 3.6))
    source = read_source([path], interval=interval(str(begin_s)))
    judged = np.unique(np.floor(10 * source.recording.time_s + 1e-6)).tolist()
    assert judged == [*range(round(10 * begin_s), 10), *range(36, 100)]
    assert source.remarks[-1].startswith("from 1.0 s to 3.6 s the sensor was being recalibrated by Carla")


def test_a_housing_that_is_turned_long_after_a_recalibration_is_none_of_its_poses(write: Write) -> None:
    path = write("a.mcap", 0, 80, sessions={0.0: "", 1.0: "Carla", 3.0: ""}, turned_s=(70.0, 71.0))
    assert len(read_source([path]).recording) == 78 * RATE_HZ


def test_text_tables_are_not_joined(tmp_path: Path, write: Write) -> None:
    table = tmp_path / "log.csv"
    table.write_text("time_s,ax_g,ay_g,az_g\n" + "".join(f"{100 + n / 10},0,0,1\n" for n in range(50)))
    with pytest.raises(InputError, match=r"log\.csv: cannot be joined with other files"):
        read_source([write("a.mcap", 0, 10), table])
    source = read_source([table], interval=interval("1", "2"))
    np.testing.assert_allclose(source.recording.time_s[[0, -1]], [101.0, 101.9])
    with pytest.raises(
        InputError, match=r"07:30:00: this recording has no UTC; give seconds from its start, 0 to 4\.9"
    ):
        read_source([table], interval=interval("07:30:00"))


def test_a_reading_that_is_repeated_counts_once_at_the_time_of_its_first_row(tmp_path: Path) -> None:
    table = tmp_path / "log.csv"
    readings = np.random.default_rng(2).normal(0.0, 0.01, 200).round(6).repeat(3)
    rows = "".join(f"{n / 100:.2f},{reading},0,1\n" for n, reading in enumerate(readings))
    table.write_text("time_s,ax_g,ay_g,az_g\n" + rows)
    source = read_source([table])
    np.testing.assert_array_equal(source.force_g[:, 0], readings[::3])
    np.testing.assert_allclose(source.recording.time_s, np.arange(200) * 0.03)
    assert source.repeated_readings == 400
    assert source.recording.lost == 0
    assert "found: the sensor is slower than its file: 33.33 readings per second in 100 rows" in source.remarks[0]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A pendulum that swings from 25 degrees and decays, by its equation, read at a third of the rope."""
    return write_swing(tmp_path / "log.csv", POSITION_M)


def write_swing(path: Path, position_m: float) -> Path:
    """Write the pendulum as a housing at a distance from the pivot reads it."""
    angle, rate, step_s, rows = np.radians(25.0), 0.0, 1e-3, []
    for i in range(40_000):
        acceleration = -STANDARD_GRAVITY_M_S2 / LENGTH_M * np.sin(angle) - 0.02 * rate
        if i % 20 == 0:
            along = np.cos(angle) + position_m * rate**2 / STANDARD_GRAVITY_M_S2
            across = np.sin(angle) + position_m * acceleration / STANDARD_GRAVITY_M_S2
            rows.append((i * step_s, across, 0.0, along))
        rate += step_s * acceleration
        angle += step_s * rate
    table = np.array(rows)
    table[:, 1:] += np.random.default_rng(3).normal(0, 1e-3, (len(table), 3))
    np.savetxt(path, table, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.6f")
    return path


@pytest.mark.slow
def test_a_length_by_the_period_is_refined_by_a_fitted_pendulum(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(HOUSING)
    found = read_rig_of_recording(path, [log])
    refined = found.refined_by(read_source([log], found.rig))
    assert found.rig.rope.length_m == pytest.approx(LENGTH_M, rel=0.05)
    assert refined.rig.rope.length_m == pytest.approx(LENGTH_M, rel=2e-3)
    assert "by a pendulum fitted" in refined.remarks[-1]


def test_a_stated_length_stays(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(f"[rope]\nlength_m = 3.1\n{HOUSING}")
    found = read_rig_of_recording(path, [log])
    assert found.refined_by(read_source([log], found.rig)) == found
    assert (found.rig.rope.length_m, found.remarks) == (3.1, ())


def test_a_wrong_value_is_told_even_where_the_rope_is_left_out(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("[housing]\nposition_m = -1\n")
    with pytest.raises(InputError, match=r"housing\.position_m: Input should be greater than or equal to 0$"):
        read_rig_of_recording(path, [log])


def test_a_housing_may_be_below_a_length_by_the_period(tmp_path: Path) -> None:
    """A rigid arm swings like a shorter pendulum, and its board may sit at its end."""
    path = tmp_path / "rig.toml"
    path.write_text("[housing]\nposition_m = 3.9\n")
    found = read_rig_of_recording(path, [write_swing(tmp_path / "log.csv", 3.9)])
    assert found.rig.rope.length_m == pytest.approx(LENGTH_M, rel=0.05)
    assert found.rig.housing.position_m == 3.9


def test_an_end_of_an_interval_without_samples_is_remarked(write: Write) -> None:
    paths = [write("a.mcap", 0, 3), write("b.mcap", 20, 4)]
    assert "3.0 to 10.0 s: no samples" in read_source(paths, interval=interval("2", "10")).remarks[-1]
    assert "10.0 to 20.0 s: no samples" in read_source(paths, interval=interval("10", "22")).remarks[-1]
    assert not any("no samples" in remark for remark in read_source(paths, interval=interval("1", "22")).remarks)
