"""The calibration against a laser beam: from photographs of its spot to the parameter and corrected angles."""

import json
import re
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main
from tests.benchmarks.laser import PLAIN
from tests.benchmarks.rendered_photographs import moved, render

PAIRS = "displacement_mm,raw_angle_deg\n107.78,1.605\n160.09,2.384\n216.80,3.224\n279.01,4.146\n"
BOARD = ["--pitch-mm", "20", "--dot-mm", "10"]


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


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A zero and a spot 85 mm below it, as JPEG."""
    folder = tmp_path_factory.mktemp("photographs")
    paths = [folder / "zero.jpg", folder / "tilted.jpg"]
    for path, scene in zip(paths, (PLAIN, moved(PLAIN, 3.0, 45.0)), strict=True):
        cv2.imwrite(str(path), render(scene), [cv2.IMWRITE_JPEG_QUALITY, 92])
    return [str(path) for path in paths]


@pytest.mark.slow
def test_photographs_give_displacements_for_the_single_parameter(
    tmp_path: Path, photographs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    table, result, overlays = tmp_path / "d.csv", tmp_path / "d.json", tmp_path / "found"
    options = ["--csv", str(table), "--json", str(result), "--overlay", str(overlays), "--by", "Ann"]
    assert main(["calibrate", "laser", *photographs, *BOARD, *options]) == 0
    written = json.loads(result.read_text())
    assert written["traceability"]["By"] == "Ann"
    assert "pitch of the dot board" in written["traceability"]["Reference"]
    zero, end = written["photographs"]
    assert (zero["d_mm"], zero["u_d_mm"], zero["segments"]) == (0, 0, [])
    assert end["d_mm"] == pytest.approx(-85, abs=0.05)
    assert end["dots"] == 47  # two are near the spot
    assert sum(segment["length_mm"] for segment in end["segments"]) == pytest.approx(85, abs=0.05)
    assert [path.name for path in sorted(overlays.iterdir())] == ["01-zero.png", "02-tilted.png"]
    header, row = table.read_text().splitlines()
    assert header == "displacement_mm,u_displacement_mm,photograph"
    assert row.endswith(",tilted.jpg")
    table.write_text(f"{header},raw_angle_deg\n{row},-1.25\n")
    assert main(["calibrate", "single-parameter", str(table), "--distance-mm", "3897"]) == 0
    assert "A_z,off = " in capsys.readouterr().out


@pytest.mark.slow
def test_the_printable_board_has_its_dots_at_true_size(tmp_path: Path) -> None:
    path = tmp_path / "board.pdf"
    assert main(["calibrate", "laser", "--board", str(path)]) == 0
    content = path.read_bytes()
    assert b"/MediaBox [0 0 841.89 1190.55]" in content  # A3, points
    streams = [zlib.decompress(found[1]) for found in re.finditer(rb"stream\r?\n(x.*?)\r?\nendstream", content, re.S)]
    (page,) = [text.decode("latin1") for text in streams if b" c f" in text]
    curves = re.findall(r"([\d.]+) ([\d.]+) m ([^mf]*?) f", page)
    assert len(curves) == 49
    mm = 25.4 / 72
    ends = [np.array(re.findall(r"([\d.]+) ([\d.]+) c", curve), dtype=float) * mm for _, _, curve in curves]
    centres = np.array([(end.max(axis=0) + end.min(axis=0)) / 2 for end in ends])
    np.testing.assert_allclose([np.ptp(end, axis=0) for end in ends], 20, atol=0.01)
    for axis in (0, 1):
        np.testing.assert_allclose(np.diff(np.unique(np.round(centres[:, axis], 1))), 40, atol=0.11)
    assert "100 mm long" in page


def test_a_board_that_fits_no_paper_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "board.pdf"
    assert main(["calibrate", "laser", "--board", str(path), "--pitch-mm", "200"]) == 2
    assert "1400 x 1400 mm fits no paper up to A0" in capsys.readouterr().err
    assert not path.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "code", "said"),
    [
        (None, 2, "cannot be read (No such file or directory)"),
        (b"no picture", 2, "is no photograph that can be read"),
        (b"", 2, "is no photograph that can be read"),
        (np.full((300, 300), 128, dtype=np.uint8), 1, "the photograph is grey"),
        (np.full((90, 90, 3), 128, dtype=np.uint8), 2, "90 x 90 pixels; sides from 200"),
        (np.dstack([np.full((300, 300), value, dtype=np.uint8) for value in (90, 100, 110)]), 1, "no lattice of dots"),
    ],
)
def test_a_photograph_that_cannot_be_used_is_named_in_one_line(
    tmp_path: Path,
    photographs: list[str],
    capsys: pytest.CaptureFixture[str],
    content: bytes | np.ndarray | None,
    code: int,
    said: str,
) -> None:
    path, table = tmp_path / "bad.png", tmp_path / "d.csv"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        cv2.imwrite(str(path), content)
    assert main(["calibrate", "laser", str(path), photographs[0], *BOARD, "--csv", str(table)]) == code
    error = capsys.readouterr().err
    assert f"{path}: " in error
    assert said in error
    assert error.count("\n") == 1
    assert not table.exists()


def test_one_photograph_is_not_enough(photographs: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "laser", photographs[0]]) == 2
    assert "at least two photographs" in capsys.readouterr().err


@pytest.mark.parametrize("lattice", ["7", "3x7", "axb"])
def test_a_lattice_that_is_none_is_refused(lattice: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["calibrate", "laser", "a.jpg", "b.jpg", "--lattice", lattice])
    assert "is not a lattice such as 7x7" in capsys.readouterr().err
