"""`plumbline calibrate single-parameter`: table 7 of Zhu et al. 2020 to a record, angles to corrected angles, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main

PAIRS = "displacement_mm,raw_angle_deg\n107.78,1.605\n160.09,2.384\n216.80,3.224\n279.01,4.146\n"


@pytest.fixture
def pairs(tmp_path: Path) -> Path:
    path = tmp_path / "pairs.csv"
    path.write_text(PAIRS)
    return path


def run(path: Path, *arguments: object) -> int:
    return main(["calibrate", "single-parameter", str(path), "--distance-mm", "3897", *map(str, arguments)])


def test_table_7_makes_a_record_and_a_certificate(
    tmp_path: Path, pairs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, page = tmp_path / "record.json", tmp_path / "record.html"
    assert run(pairs, "--device-id", "p7", "--json", out, "--html", page) == 0
    record = CalibrationRecord.model_validate(json.loads(out.read_text()))
    numbers = (record.model_extra or {})["single_parameter"]
    assert (record.method, record.unit, record.device_id) == ("single-parameter", "g", "p7")
    assert numbers["a_z_off_mg"] == pytest.approx(-12.7, abs=0.2)
    assert record.offset == [0, 0, pytest.approx(np.expm1(numbers["a_z_off_mg"] / 1000))]
    assert np.sqrt(record.covariance[9][9]) == pytest.approx(0.025 / np.sqrt(3))
    assert [round(pair["a_z_off_mg"], 1) for pair in numbers["pairs"]] == [-13.0, -13.3, -12.4, -12.3]
    assert "A_z,off of each pair" in page.read_text()
    output = capsys.readouterr().out
    assert "approximation by exp, as figure 7: 0.008 %" in output
    assert "for relative angles within +-5 deg only" in output


def test_raw_angles_are_corrected_with_their_uncertainty(tmp_path: Path, pairs: Path) -> None:
    angles, out = tmp_path / "angles.csv", tmp_path / "corrected.csv"
    angles.write_text("raw_angle_deg\n1\n-4.5\n")
    assert run(pairs, "--apply", angles, "--corrected", out) == 0
    header, *rows = out.read_text().splitlines()
    assert header == "raw_angle_deg,angle_deg,u_deg"
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    np.testing.assert_allclose(values[:, 1] / values[:, 0], np.exp(-0.0128), atol=3e-4)
    assert np.all((values[:, 2] > 0.0005) & (values[:, 2] < 0.005))


def test_an_angle_beyond_the_range_is_refused_and_nothing_is_written(
    tmp_path: Path, pairs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    angles, out, record = tmp_path / "angles.csv", tmp_path / "corrected.csv", tmp_path / "record.json"
    angles.write_text("raw_angle_deg\n1\n5.2\n")
    assert run(pairs, "--apply", angles, "--corrected", out, "--json", record) == 2
    error = capsys.readouterr().err
    assert f"{angles}: a relative angle of 5.1" in error
    assert error.count("\n") == 1
    assert not out.exists()
    assert not record.exists()


def test_a_pair_of_opposite_signs_is_refused(pairs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pairs.write_text(PAIRS.replace("2.384", "-2.384"))
    assert run(pairs) == 1
    assert "pair 2: displacement and raw angle must be" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("raw_angle_deg", "angle"), "line 1: no column raw_angle_deg"),
        (("160.09", "160,09"), "line 3: 3 cells, the header has 2"),
        ((PAIRS, "displacement_mm,raw_angle_deg\n"), "no rows below the header"),
        ((PAIRS, ""), "the file is empty"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(
    pairs: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, str], said: str
) -> None:
    pairs.write_text(PAIRS.replace(*change))
    assert run(pairs) == 2
    error = capsys.readouterr().err
    assert f"{pairs}: {said}" in error
    assert error.count("\n") == 1


def test_angles_to_correct_need_a_place_for_the_result(pairs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(pairs, "--apply", pairs) == 2
    assert "--apply and --corrected belong together" in capsys.readouterr().err
