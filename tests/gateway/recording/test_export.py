"""Recordings as CSV, Parquet and MCAP; the example of the guide reads them in every state with the public reader."""

import contextlib
import csv
import io
import json
import os
import re
import shutil
from pathlib import Path
from textwrap import dedent

import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

from gateway.cli.main import main
from gateway.measurement.measure import measure
from gateway.measurement.rig_file import read_rig
from gateway.measurement.source import read_source
from gateway.recording.export import tables
from gateway.recording.export.tables import samples_table
from gateway.recording.reading.interval import RecordingInterval
from gateway.recording.reading.recording_file import EVERYTHING
from gateway.recording.reading.sample_calibration import CalibratedReader
from gateway.recording.reading.samples import read_samples
from gateway.recording.reading.timeline import open_timeline
from tests.clocks import START_NS
from tests.gateway.recording.recorded_crane import CLOCK, RecordedCrane
from tests.values import present

SECONDS = 45
INCOMPLETE = "the file is incomplete, or still being written"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """45 s of the simulated crane in three segments."""
    crane = RecordedCrane(tmp_path_factory.mktemp("data"))
    crane.record(SECONDS)
    return crane.close()


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def export(*arguments: str | Path) -> int:
    return main(["record", "export", *map(str, arguments)])


@pytest.mark.slow
def test_csv_has_every_sample_with_its_calibrated_force(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "samples.csv"
    assert export(recorded, "--csv", out) == 0
    assert out.read_text().startswith("time_s,ax_g,ay_g,az_g,temperature_c\n")
    expected = read_source([recorded])
    found = read_source([out])
    np.testing.assert_allclose(found.recording.time_s, expected.recording.time_s, atol=1e-9)
    np.testing.assert_allclose(found.force_g, expected.force_g, rtol=1e-8, atol=1e-9)
    assert len(found.recording) == SECONDS * 100


@pytest.mark.slow
def test_measure_of_the_exported_csv_gives_the_same_swing(recorded: Path, tmp_path: Path) -> None:
    out, rig = tmp_path / "samples.csv", tmp_path / "rig.toml"
    rig.write_text(
        "[rope]\nlength_m = 12.0\n[housing]\nposition_m = 9.0\n[sensor]\nsample_rate_hz = 100\n"
        f"noise_g = {read_samples(sorted(recorded.glob('*.mcap'))[:1]).device.noise_g}\n"
    )
    assert export(recorded, "--csv", out) == 0
    part = RecordingInterval(last_s=14.0)
    direct, exported = (measure(read_source([path], read_rig(rig), part)) for path in (recorded, out))
    # A table does not say how well its sensor is calibrated: its wider interval does.
    assert present(exported.swing.u_rad) > present(direct.swing.u_rad)
    u_rad = present(exported.swing.u_rad)
    assert exported.swing.phi_max_rad == pytest.approx(present(direct.swing.phi_max_rad), abs=u_rad / 5)


def test_interval_is_cut_at_the_sample(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "part.csv"
    assert export(recorded, "--csv", out, "--from", "19.5", "--to", "21.53") == 0
    times = [float(row["time_s"]) for row in rows(out)]
    assert len(times) == 203
    assert [times[0], times[-1]] == pytest.approx([19.5, 21.52])
    assert export(recorded, "--csv", out, "--last", "1") == 0
    assert len(rows(out)) == 101


@pytest.mark.slow
def test_parquet_has_the_same_samples_with_utc(recorded: Path, tmp_path: Path) -> None:
    out, text = tmp_path / "samples.parquet", tmp_path / "samples.csv"
    assert export(recorded, "--parquet", out) == export(recorded, "--csv", text) == 0
    table = pq.read_table(out)
    assert table.column_names == ["time_s", "utc", "ax_g", "ay_g", "az_g", "temperature_c"]
    first_ns = table["utc"][0].value
    assert first_ns == read_samples(sorted(recorded.glob("*.mcap"))[:1]).samples.time_ns[0] + CLOCK.wall_offset_ns
    assert table["az_g"].to_pylist() == pytest.approx([float(row["az_g"]) for row in rows(text)], rel=1e-8)
    assert table.schema.metadata[b"gateway"] == b"demo-site/crane-1/hook-1"


@pytest.mark.slow
def test_mcap_has_plain_numbers_at_full_rate_beside_the_other_topics(recorded: Path, tmp_path: Path) -> None:
    out, text = tmp_path / "full.mcap", tmp_path / "samples.csv"
    assert export(recorded, "--mcap", out) == export(recorded, "--csv", text) == 0
    expected = rows(text)
    with out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = list(reader.iter_messages(topics=["/acceleration_samples"]))
        schema = present(found[0][0])
        assert json.loads(schema.data)["properties"]["ax_g"]["type"] == "number"
        contents = [json.loads(message.data) for _, _, message in found]
        assert [content["ax_g"] for content in contents] == pytest.approx([float(row["ax_g"]) for row in expected])
        assert contents[7]["norm_g"] == pytest.approx(
            np.hypot(np.hypot(*(contents[7][f"a{k}_g"] for k in "xy")), contents[7]["az_g"])
        )
        first, last = found[0][2], found[-1][2]
        assert last.log_time - first.log_time == pytest.approx(float(expected[-1]["time_s"]) * 1e9, abs=1)
        assert first.publish_time - first.log_time == CLOCK.wall_offset_ns
        motion = [message.data for _, _, message in reader.iter_messages(topics=["/motion"])]
    recorded_motion = []
    for path in sorted(recorded.glob("*.mcap")):
        with path.open("rb") as file:
            recorded_motion += [message.data for _, _, message in make_reader(file).iter_messages(topics=["/motion"])]
    assert motion == recorded_motion


def test_topic_is_a_table_with_a_column_for_each_number(recorded: Path, tmp_path: Path) -> None:
    out, parquet = tmp_path / "motion.csv", tmp_path / "motion.parquet"
    assert export(recorded, "--csv", out, "--topic", "motion") == 0
    assert export(recorded, "--parquet", parquet, "--topic", "motion") == 0
    table = rows(out)
    known = [row for row in table if row["angle_deg"]]
    assert len(table) == 10 * SECONDS
    assert known
    assert {"time_s", "utc", "u_deg", "pivot_accel_m_s2.x", "pivot_accel_m_s2.y", "probabilities.free"} <= set(table[0])
    assert table[0]["utc"] == "2026-01-01T00:00:00.340000000Z"
    angles = [angle for angle in pq.read_table(parquet)["angle_deg"].to_pylist() if angle is not None]
    assert angles == pytest.approx([float(row["angle_deg"]) for row in known], rel=1e-8)


def test_incomplete_recording_is_exported_up_to_its_end(recorded: Path, tmp_path: Path) -> None:
    paths = sorted(recorded.glob("*.mcap"))
    torn = tmp_path / paths[-1].name
    torn.write_bytes(paths[-1].read_bytes())
    os.truncate(torn, torn.stat().st_size // 3)
    out = tmp_path / "samples.csv"
    assert export(*paths[:-1], torn, "--csv", out) == 0
    assert 4000 < len(rows(out)) < 4500


def test_unreadable_part_is_a_loss_of_its_own_exit_code(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = sorted(recorded.glob("*.mcap"))[0]
    content = bytearray(path.read_bytes())
    place = content.index(b"zstd", len(content) // 2) + 40  # inside the data of a chunk
    content[place] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(content)
    assert export(damaged, "--csv", tmp_path / "samples.csv") == 3
    assert "1 damaged record left out" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--csv", "{out}", "--from", "100"], "--from 100: is after the recording, which is 0 to 44.990 s"),
        (["--csv", "{out}", "--topic", "speed"], "--topic speed: is not a topic; choose one of samples, "),
        (["--mcap", "{out}", "--topic", "motion"], "--topic: an MCAP contains every topic"),
        (["--csv", "{first}"], "is one of the recordings; choose another name"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    first = sorted(recorded.glob("*.mcap"))[0]
    size = first.stat().st_size
    assert export(recorded, *(part.format(out=tmp_path / "x", first=first) for part in arguments)) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    assert first.stat().st_size == size


def test_samples_are_read_as_they_are_written(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "BATCH_ROWS", 500)
    timeline = open_timeline([recorded])
    shares: list[float] = []
    table = samples_table(CalibratedReader(timeline, EVERYTHING), START_NS, with_utc=False, report=shares.append)
    progress = [(len(batch[0]), shares[-1]) for batch in table.batches]
    assert [count for count, _ in progress] == [500] * 9
    steps = np.diff([0.0, *(share for _, share in progress)]) * len(progress)
    assert steps.min() > 0.5, "half of what an even step would be"
    assert steps.max() < 2.0, "and twice: files have more in them than samples"


def test_first_sample_is_at_the_start_of_the_simulated_crane(recorded: Path) -> None:
    assert read_samples(sorted(recorded.glob("*.mcap"))[:1]).samples.time_ns[0] == START_NS


GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "investigator" / "recordings.md"


def example() -> str:
    """The indented block of the section on Python that imports the reader."""
    section = GUIDE.read_text().split("## In Python")[1].split("\n## ")[0]
    (block,) = (each for each in re.findall(r"(?:^ {4}.*\n|^\n)+", section, re.MULTILINE) if "NonSeekingReader" in each)
    return dedent(block)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file that is being written, the same torn, and the same closed."""
    folder = tmp_path_factory.mktemp("data")
    crane = RecordedCrane(folder / "data", segment_s=600.0)
    crane.record(12)
    (path,) = crane.folder.glob("*.mcap")
    live, torn = folder / "live.mcap", folder / "torn.mcap"
    shutil.copy(path, live)
    shutil.copy(path, torn)
    os.truncate(torn, torn.stat().st_size - 1000)
    crane.close()
    return {"live": live, "torn": torn, "closed": path}


@pytest.mark.slow
@pytest.mark.parametrize("state", ["live", "torn", "closed"])
def test_example_of_the_guide_reads_a_recording(
    recordings: dict[str, Path], state: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(recordings[state], tmp_path / "recording.mcap")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(example(), names)
    lines = printed.getvalue().splitlines()
    assert (INCOMPLETE in lines) == (state != "closed")
    swings = [line for line in lines if line != INCOMPLETE]
    assert len(swings) >= 3
    assert len(names["x_counts"]) == 10  # type: ignore[arg-type]
