"""`plumbline calibrate rotation`: files in, record, report and certificate out; what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main
from tests.benchmarks.rotation_turns import Rig, draw_sensor, turn

HEADER = "angle_deg,ax_v,ay_v,az_v,count,temperature_c"


def write_turn(path: Path, rotation_axis: int, repeats: int = 1) -> Path:
    readings = turn(np.random.default_rng(rotation_axis), draw_sensor(np.random.default_rng(2)), rotation_axis, Rig())
    volts = 1.5 + 0.42 * readings.mean
    rows = [
        f"{np.degrees(angle):.2f},{x:.6f},{y:.6f},{z:.6f},50,21.5"
        for _ in range(repeats)
        for angle, (x, y, z) in zip(readings.angle_rad, volts, strict=True)
    ]
    path.write_text("\n".join([HEADER, *rows]) + "\n")
    return path


def test_two_turns_make_a_record_with_its_curves_and_a_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(write_turn(tmp_path / "y.csv", 1)), str(write_turn(tmp_path / "x.csv", 0))]
    out, page = tmp_path / "record.json", tmp_path / "record.html"
    assert main(["calibrate", "rotation", *files, "--device-id", "p7", "--json", str(out), "--html", str(page)]) == 0
    record = CalibrationRecord.model_validate(json.loads(out.read_text()))
    sensitivity, offset_g = draw_sensor(np.random.default_rng(2))
    assert (record.method, record.unit, record.device_id) == ("rotation", "V", "p7")
    np.testing.assert_allclose((np.array(record.offset) - 1.5) / 0.42, offset_g, atol=3e-4)
    np.testing.assert_allclose(0.42 * np.array(record.correction_matrix), np.linalg.inv(sensitivity), atol=0.01)
    assert record.temperature_c == {"mean": 21.5, "min": 21.5, "max": 21.5}
    curves = (record.model_extra or {})["rotation"]["curves"]
    assert [(curve["rotation_axis"], curve["axis"]) for curve in curves] == [*zip("yyxx", "xzyz", strict=True)]
    assert page.read_text().count("data-series=") == 4
    assert "non-orthogonality of x and y" in capsys.readouterr().out


def test_repeated_rows_at_an_angle_are_averaged(tmp_path: Path) -> None:
    files = [str(write_turn(tmp_path / f"{axis}.csv", axis, repeats=3)) for axis in (1, 0)]
    out = tmp_path / "record.json"
    assert main(["calibrate", "rotation", *files, "--json", str(out)]) == 0
    poses = json.loads(out.read_text())["poses"]
    assert [pose["count"] for pose in poses] == [150] * 72


def test_one_turn_prints_two_axes_and_makes_no_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(write_turn(tmp_path / "y.csv", 1))
    assert main(["calibrate", "rotation", file]) == 0
    assert "non-orthogonality of x and z" in capsys.readouterr().out
    out = tmp_path / "record.json"
    assert main(["calibrate", "rotation", file, "--json", str(out)]) == 2
    assert "a record needs a second turn" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("angle_deg", "degrees"), "line 1: no column angle_deg"),
        (("temperature_c", "humidity"), "line 1: column 'humidity' is unknown"),
        ((",50,", ",0.5,"), "line 2: count is no whole number"),
        (("\n10.00,", "\nten,"), "line 3: angle_deg is 'ten', not a number"),
        (("21.5\n20.00", "nan\n20.00"), "line 3: temperature_c is 'nan', not a number"),
        (("21.5\n20.00", "21.5,7\n20.00"), "line 3: 7 cells, the header has 6"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, str], said: str
) -> None:
    path = write_turn(tmp_path / "y.csv", 1)
    path.write_text(path.read_text().replace(*change))
    assert main(["calibrate", "rotation", str(path)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert str(path) in error


def test_half_a_turn_is_not_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_turn(tmp_path / "y.csv", 1)
    path.write_text("\n".join(path.read_text().splitlines()[:20]) + "\n")
    assert main(["calibrate", "rotation", str(path)]) == 1
    assert "turn the sensor through the full circle" in capsys.readouterr().err
