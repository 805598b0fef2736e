"""`plumbline calibrate laser`: photographs to displacements, overlays and a printable board; what is refused."""

import json
import re
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from gateway.cli.main import main
from tests.benchmarks.laser import PLAIN
from tests.benchmarks.rendered_photographs import moved, render

BOARD = ["--pitch-mm", "20", "--dot-mm", "10"]


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
