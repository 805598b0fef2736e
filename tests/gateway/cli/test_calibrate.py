"""`plumbline calibrate`: real and simulated recordings to records, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.block import DeviceInfo
from gateway.calibration.pose import NominalSensitivity
from gateway.calibration.pose_procedure import make_procedure
from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main
from tests.benchmarks.calibration_sessions import (
    ADXL355,
    RATE_HZ,
    SensorErrors,
    draw_errors,
    place_faces,
    requested_poses,
    specific_force,
    split_blocks,
    to_counts,
    unit,
)
from tests.recordings import write_mcap
from tests.values import present

DATA = Path(__file__).parents[2] / "data" / "calibration"
TABLES = json.loads((DATA / "luczak_2022_tables.json").read_text())
SIX_FACES, MANY_POSES = DATA / "six_faces_session.csv", DATA / "many_poses_session.csv"
IMUCAL_MATRIX = [
    [0.0004887077301615101, -3.3841807407715582e-06, 5.42131118127749e-06],
    [4.128019851776486e-06, 0.0004901271739444974, -1.117816712680946e-05],
    [-1.0327686771363506e-05, 5.298306373897759e-06, 0.00047453454498270776],
]
IMUCAL_OFFSET = [-6.232558139534831, -48.31395348837202, -28.72790697674418]
"""imucal 2.6.0 on the labelled parts of `six_faces_session.csv`, in g per count and counts."""


def calibrate(tmp_path: Path, *arguments: Any) -> tuple[int, CalibrationRecord | None]:
    """Return the exit code, and the record or None."""
    out = tmp_path / "record.json"
    out.unlink(missing_ok=True)
    code = main(["calibrate", *map(str, arguments), "--json", str(out)])
    return code, CalibrationRecord.model_validate(json.loads(out.read_text())) if out.exists() else None


def calibrated(tmp_path: Path, *arguments: Any) -> tuple[int, CalibrationRecord]:
    """Return the exit code and the record."""
    code, record = calibrate(tmp_path, *arguments)
    return code, present(record)


def write(path: Path, columns: str, rows: NDArray[np.float64], rate_hz: float = RATE_HZ) -> Path:
    lines = [f"{number / rate_hz:.4f},{','.join(map(str, row))}" for number, row in enumerate(rows.tolist())]
    path.write_text("\n".join([f"time_s,{columns}", *lines]) + "\n")
    return path


def session(method: str, seed: int = 3) -> tuple[SensorErrors, NDArray[np.float64]]:
    random = np.random.default_rng(seed)
    errors = draw_errors(random)
    poses = place_faces(random, 0.02) if method == "six-position" else requested_poses(random)
    return errors, to_counts(random, ADXL355, errors, specific_force(random, poses))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_offline_calibration_makes_the_record_of_a_live_session(
    tmp_path: Path, method: str, capsys: pytest.CaptureFixture[str]
) -> None:
    errors, counts = session(method)
    path = write(tmp_path / "session.csv", "ax_counts,ay_counts,az_counts", counts)
    code, record = calibrated(
        tmp_path, method, path, "--units-per-g", 256000, "--device-id", "adxl355-1d", "--by", "Ada"
    )
    assert code == 0
    live = make_procedure(method, NominalSensitivity(256000.0))
    for readings in split_blocks(counts, size=32):
        live.feed(readings)
    fit = live.finish()
    assert record.correction_matrix == fit.correction_matrix.tolist()
    assert record.offset == list(fit.offset)
    assert record.covariance == fit.covariance.tolist()
    assert (record.device_id, record.by, record.unit, record.parent) == ("adxl355-1d", "Ada", "counts", None)
    np.testing.assert_allclose(np.array(record.offset) / 256000, errors.offset_g, atol=5e-4)
    output = capsys.readouterr().out
    assert f"record {record.id}" in output
    assert "standard uncertainty of a reading" in output


@pytest.mark.slow
def test_a_recording_of_the_gateway_gives_the_record_of_the_same_readings_as_a_table(tmp_path: Path) -> None:
    _, counts = session("six-position")
    device = DeviceInfo(kind="adxl355", device_id="adxl355-1d", unit="counts", odr_hz=RATE_HZ, units_per_g=256000.0)
    half = len(counts) // 2
    parts = [
        write_mcap(tmp_path / "a.mcap", device, counts[:half]),
        write_mcap(tmp_path / "b.mcap", device, counts[half:], begin_s=half / RATE_HZ),
    ]
    code, recorded = calibrated(tmp_path, "six-position", *parts)
    table = write(tmp_path / "session.csv", "ax_counts,ay_counts,az_counts", counts)
    _, tabled = calibrated(tmp_path, "six-position", table, "--units-per-g", 256000)
    assert (code, recorded.device_id, recorded.unit) == (0, "adxl355-1d", "counts")
    np.testing.assert_allclose(recorded.offset, tabled.offset)
    np.testing.assert_allclose(recorded.correction_matrix, tabled.correction_matrix)


def test_a_recording_of_another_device_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device = DeviceInfo(kind="adxl355", device_id="adxl355-1d", unit="counts", odr_hz=RATE_HZ, units_per_g=256000.0)
    path = write_mcap(tmp_path / "a.mcap", device, session("six-position")[1])
    code, record = calibrate(tmp_path, "six-position", path, "--device-id", "other")
    assert (code, record) == (2, None)
    assert "adxl355-1d and other; give one device" in capsys.readouterr().err
    code, _ = calibrate(tmp_path, "six-position", path, "--unit", "g")
    assert code == 2
    assert "leave --columns, --unit" in capsys.readouterr().err


@pytest.mark.slow
def test_six_faces_are_found_in_a_session_with_other_poses(tmp_path: Path) -> None:
    """The faces, and poses 10 to 20 degrees off a face or between faces, in one session."""
    random = np.random.default_rng(5)
    errors = draw_errors(random)
    others = unit(
        np.array([[1, 0.2, 0], [-0.3, 1, 0], [0.1, 0.2, -1], [0.33, 0, -1], [1, 1, 0.3], [-1, 0.8, 1], [0, -1, 1]])
    )
    poses = np.vstack([others[:4], place_faces(random, 0.02), others[4:]])
    counts = to_counts(random, ADXL355, errors, specific_force(random, poses))
    path = write(tmp_path / "session.csv", "ax_counts,ay_counts,az_counts", counts)
    code, record = calibrated(tmp_path, "six-position", path, "--units-per-g", 256000)
    assert code == 0
    assert [pose["used"] for pose in record.poses] == [False] * 4 + [True] * 6 + [False] * 3
    np.testing.assert_allclose(np.array(record.offset) / 256000, errors.offset_g, atol=5e-4)
    assert "non-linearity" in [row.source for row in record.budget]


@pytest.mark.slow
def test_an_unknown_sensitivity_is_estimated_from_the_readings(tmp_path: Path) -> None:
    _, counts = session("six-position")
    path = write(tmp_path / "session.csv", "ax,ay,az", counts)
    code, found = calibrated(tmp_path, "six-position", path)
    _, given = calibrated(tmp_path, "six-position", path, "--units-per-g", 256000)
    assert code == 0
    assert found.unit == "counts"
    np.testing.assert_allclose(found.offset, given.offset, atol=256000 * 1e-5)
    np.testing.assert_allclose(found.correction_matrix, given.correction_matrix, rtol=1e-3, atol=1e-9)


def test_one_file_per_pose_in_volts_in_any_order_reproduces_table_1(tmp_path: Path) -> None:
    """Table 1 of Łuczak et al. 2022 as six recordings: its offsets, scale factors and misalignment angles."""
    random = np.random.default_rng(2)
    files = []
    for row in TABLES["tables_1_to_5"][0]["positions"][::-1]:
        noise = 0.0005 * random.standard_normal((400, 3))
        volts = np.array([row["U_x_V"], row["U_y_V"], row["U_z_V"]]) + noise - noise[26:326].mean(axis=0)
        files.append(write(tmp_path / f"{row['position']}.csv", "ax_v,ay_v,az_v", volts))
    code, record = calibrated(tmp_path, "six-position", *files)
    assert (code, record.unit) == (0, "V")
    np.testing.assert_allclose(record.offset, [1.4765, 1.4882, 1.5102], atol=1e-4)
    np.testing.assert_allclose(np.diag(np.linalg.inv(record.correction_matrix)), [0.4172, 0.4141, 0.4168], atol=1e-4)
    expected = {"x": [1.318, -1.579], "y": [0.533, -3.211], "z": [1.065, -3.218]}
    for axis, angles in expected.items():
        np.testing.assert_allclose(present(record.misalignment_deg)[axis], angles, atol=0.02)


def test_a_real_session_agrees_with_imucal(tmp_path: Path) -> None:
    code, record = calibrated(tmp_path, "six-position", SIX_FACES, "--rate", 204.8)
    assert code == 0
    np.testing.assert_allclose(record.offset, IMUCAL_OFFSET, atol=0.25)  # counts of 0.5 mg
    np.testing.assert_allclose(record.correction_matrix, IMUCAL_MATRIX, atol=3e-7)
    assert record.residual_rms_g == pytest.approx(4.2e-3, abs=0.1e-3)


@pytest.mark.slow
def test_a_real_session_held_by_hand_is_not_accepted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, record = calibrated(tmp_path, "six-position", MANY_POSES, "--rate", 100)
    assert code == 1
    assert [pose["face"] for pose in record.poses] == ["+z", "-z", "-x", "+x", "-y", "+y", None, None, None, None]
    assert record.residual_rms_g == pytest.approx(0.0145, abs=0.001)
    output = capsys.readouterr().out
    assert "not acceptable: residual 0.0145 g is above the limit of 0.01" in output
    assert "the faces lay worse than the 0.1 deg stated: 1.25 deg is reckoned with" in output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["norm-fit", MANY_POSES, "--rate", "100"], "10 poses in {}: the poses do not determine cross-axis xy"),
        (["norm-fit", SIX_FACES, "--rate", "204.8"], "6 poses in {}: 6 poses for 9 unknowns; take 3 more"),
    ],
)
def test_poses_that_leave_a_parameter_undetermined_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[Path | str], text: str
) -> None:
    code, record = calibrate(tmp_path, *arguments)
    assert (code, record) == (1, None)
    err = capsys.readouterr().err
    assert text.format(arguments[1]) in err
    assert err.count("\n") == 1


def test_a_missing_face_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, counts = session("six-position")
    path = write(tmp_path / "session.csv", "ax,ay,az", counts[: 5 * 460])
    code, record = calibrate(tmp_path, "six-position", path)
    assert (code, record) == (1, None)
    assert "missing: lay the sensor with" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("columns", "factor", "unit"), [("ax,ay,az", 1, "V"), ("ax_v,ay_v,az_v", 1, "V"), ("ax,ay,az", 4096, "counts")]
)
def test_an_analogue_zero_is_found_for_any_names_of_the_columns(
    tmp_path: Path, columns: str, factor: int, unit: str
) -> None:
    random = np.random.default_rng(2)
    table = np.array([[row["U_x_V"], row["U_y_V"], row["U_z_V"]] for row in TABLES["tables_1_to_5"][0]["positions"]])
    readings = (np.repeat(table, 400, axis=0) + 0.0005 * random.standard_normal((2400, 3))) * factor
    path = write(tmp_path / "session.csv", columns, np.rint(readings) if factor > 1 else readings)
    code, record = calibrated(tmp_path, "six-position", path)
    assert (code, record.unit) == (0, unit)
    np.testing.assert_allclose(np.array(record.offset) / factor, [1.4765, 1.4882, 1.5102], atol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "gravity"), [(9.80665, "9.64 g"), (0.3, "0.295 g"), (1000.0, "983 g")])
def test_readings_that_are_not_in_g_are_refused_under_a_header_that_says_g(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], factor: float, gravity: str
) -> None:
    _, counts = session("six-position")
    path = write(tmp_path / "session.csv", "ax_g,ay_g,az_g", counts / 256000 * factor)
    assert calibrate(tmp_path, "six-position", path) == (2, None)
    assert f"gravity reads {gravity}" in capsys.readouterr().err


@pytest.mark.parametrize(("poses", "text"), [(5, "face"), (1, "volts per g")])
def test_readings_in_volts_without_a_face_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], poses: int, text: str
) -> None:
    random = np.random.default_rng(2)
    files = []
    for row in TABLES["tables_1_to_5"][0]["positions"][:poses]:
        volts = np.array([row["U_x_V"], row["U_y_V"], row["U_z_V"]]) + 0.0005 * random.standard_normal((400, 3))
        files.append(write(tmp_path / f"{row['position']}.csv", "ax_v,ay_v,az_v", volts))
    code, record = calibrate(tmp_path, "six-position", *files)
    assert (code, record) == (1, None)
    assert text in capsys.readouterr().err


@pytest.mark.slow
def test_the_parent_is_named_and_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    errors, counts = session("six-position")
    path = write(tmp_path / "session.csv", "ax,ay,az", counts)
    _, first = calibrated(tmp_path, "six-position", path, "--device-id", "d")
    parent = (tmp_path / "record.json").rename(tmp_path / "parent.json")
    moved = write(tmp_path / "later.csv", "ax,ay,az", counts + np.array([0, 0, 0.04 * 256000]))
    code, second = calibrated(tmp_path, "six-position", moved, "--device-id", "d", "--parent", parent)
    assert (code, second.parent) == (0, first.id)
    moved_mg = 40 / errors.gain[2, 2]  # 40 mg as the uncorrected part reads them
    assert f"needs a reason: offset z has moved by +{moved_mg:.1f} mg since {first.id}" in capsys.readouterr().out
    code, _ = calibrate(tmp_path, "six-position", moved, "--device-id", "other", "--parent", parent)
    assert code == 2
    assert "belongs to d, not to other" in capsys.readouterr().err


BAD: dict[str, tuple[str, str | None, list[str], str]] = {
    "no such file": ("none.csv", None, [], "no such file"),
    "no axes": ("a.csv", "time_s,p,q,r\n0,1,2,3\n", [], "which columns are the axes"),
    "no time": ("b.csv", "ax,ay,az\n1,2,3\n4,5,6\n", [], "give --rate HZ"),
    "unit unknown": ("c.csv", "time_s,ax,ay,az\n0,0.1,0.2,23.5\n1,0.1,0.2,23.5\n", [], "give --unit"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_reported_in_one_line_and_writes_no_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    name, text, options, expected = BAD[case]
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    code, record = calibrate(tmp_path, "six-position", path, *options)
    err = capsys.readouterr().err
    assert (code, record) == (2, None)
    assert expected in err
    assert name in err
    assert err.count("\n") == 1


def test_files_in_different_units_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = np.tile([0.0, 0.0, 1.0], (50, 1))
    files = [write(tmp_path / "a.csv", "ax_g,ay_g,az_g", rows), write(tmp_path / "b.csv", "ax_v,ay_v,az_v", rows)]
    code, _ = calibrate(tmp_path, "six-position", *files)
    assert code == 2
    assert "the files are in V and g" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_help_has_an_example(method: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["calibrate", method, "--help"])
    assert stop.value.code == 0
    assert f"example: plumbline calibrate {method}" in " ".join(capsys.readouterr().out.split())
