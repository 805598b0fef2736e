"""A CSV recording is read whatever its columns, delimiters, line ends and time stamps; real ones too."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from devices.tables.layout import NATIVE, TableLayout
from devices.tables.native import read_table
from tests.devices.tables.table_lines import HEADER, PHONE, REAL, SIX_POSITION, WriteTable, counts, kept_rows, rows

Delimiter = Literal[",", "\t", " "]


def test_native_recording(table: WriteTable) -> None:
    recording = read_table(table(HEADER, *rows(5)))
    np.testing.assert_allclose(recording.time_s, [0, 0.02, 0.04, 0.06, 0.08])
    np.testing.assert_array_equal(recording.raw[3], [0.003, -0.01, 0.999])
    assert recording.unit == "g"
    assert recording.rate_hz == pytest.approx(50)
    assert recording.temperature_c is None
    assert recording.gyro_dps is None
    assert counts(recording) == {}


def test_native_columns_may_be_in_any_order_among_others(table: WriteTable) -> None:
    header = "note,gz_dps,temperature_c,az_g,ay_g,ax_g,gx_dps,gy_dps,time_s"
    recording = read_table(
        table(header, "a,9,21.5,0.3,0.2,0.1,7,8,0", "b,9,nan,0.3,0.2,0.1,7,8,1", "c,9,,0.3,0.2,0.1,7,8,2")
    )
    np.testing.assert_array_equal(recording.raw, [[0.1, 0.2, 0.3]] * 3)
    np.testing.assert_array_equal(recording.temperature_c, [21.5, np.nan, np.nan])
    np.testing.assert_array_equal(recording.gyro_dps, [[7, 8, 9]] * 3)
    assert counts(recording) == {}


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_ends_and_byte_order_mark(tmp_path: Path, newline: str) -> None:
    path = tmp_path / "recording.csv"
    path.write_bytes(b"\xef\xbb\xbf" + newline.join([HEADER, *rows(4), ""]).encode())
    recording = read_table(path)
    assert kept_rows(recording) == [0, 1, 2, 3]
    assert counts(recording) == {}


def test_rows_keep_their_order_over_many_blocks_of_text(table: WriteTable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("devices.tables.native.BLOCK_CHARS", 64)
    whole = rows(50)
    whole[20] = "broken"
    recording = read_table(table("# made by hand", HEADER, *whole))
    assert kept_rows(recording) == [*range(20), *range(21, 50)]
    assert np.flatnonzero(recording.unusable_before).tolist() == [20]


def test_a_line_without_end_is_not_collected(table: WriteTable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("devices.tables.native.BLOCK_CHARS", 64)
    recording = read_table(table(HEADER, *rows(5), "9" * 1000, *rows(12)[5:]))
    assert kept_rows(recording) == list(range(12))
    assert recording.invalid > 0


def test_coarse_time_stamps_are_not_gaps(table: WriteTable) -> None:
    time_ms = [0, 2, 5, 7, 10, 12, 15, 17, 20]  # 400 Hz in whole milliseconds
    layout = replace(NATIVE, time="ms", rate_hz=1000)
    recording = read_table(table("ms,ax_g,ay_g,az_g", *(f"{time},0.0,0.0,1.0" for time in time_ms)), layout)
    assert recording.lost == 0
    assert recording.rate_hz == pytest.approx(400)


def test_rows_without_time_are_consecutive_even_with_an_unusable_one(table: WriteTable) -> None:
    layout = TableLayout(axes=(1, 2, 3), unit="counts", rate_hz=100)
    recording = read_table(table("Fs,100", "10,20,30", "11,21,31", "x,y,z", "13,23,33"), layout)
    np.testing.assert_allclose(recording.time_s, [0, 0.01, 0.03])
    assert counts(recording) == {"invalid": 1}


def test_header_below_other_lines(table: WriteTable) -> None:
    layout = TableLayout(axes=("ax", "ay", "az"), unit="counts", rate_hz=100)
    preamble = ("Fs,100", "Logging Type,0", "Initialization time,36.5", "Waiting time,3")
    recording = read_table(
        table(*preamble, "ax,ay,az,gx,gy,gz", "-12,-812,15032,-447,156,-86", "-208,-828,14796,-398,132,-63"), layout
    )
    assert recording.raw.tolist() == [[-12, -812, 15032], [-208, -828, 14796]]
    assert recording.unit == "counts"


def test_counts_are_whole_numbers(table: WriteTable) -> None:
    layout = TableLayout(axes=(1, 2, 3), unit="counts", rate_hz=100)
    recording = read_table(table("1,2,3", "1,2,3.5", "1,2,3", "1,2,3.0"), layout)
    assert len(recording) == 3
    assert recording.invalid == 1


@pytest.mark.parametrize("delimiter", [",", "\t", " "])
def test_delimiters(table: WriteTable, delimiter: Delimiter) -> None:
    lines = [delimiter.join(entries) for entries in (("0.0", "1", "2", "3"), ("0.1", "4", "5", "6"))]
    layout = TableLayout(time=1, axes=(2, 3, 4), unit="g", delimiter=delimiter)
    assert read_table(table(*lines), layout).raw.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_columns_may_be_separated_by_many_spaces(table: WriteTable) -> None:
    layout = TableLayout(time="t", axes=("x", "y", "z"), unit="g", delimiter=" ")
    recording = read_table(table("  t   x  y    z", " 0.0   1  2    3", " 0.1   4  5    6 "), layout)
    assert recording.raw.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_real_six_position_session() -> None:
    recording = read_table(REAL / "six_position_session.csv", SIX_POSITION)
    assert len(recording) == 300
    assert counts(recording) == {}
    assert recording.rate_hz == pytest.approx(204.8)
    faces = recording.raw.reshape(6, 50, 3).mean(axis=1) / 2048
    expected = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]]
    np.testing.assert_allclose(faces, expected, atol=0.07)


def test_real_phone_at_rest() -> None:
    recording = read_table(REAL / "phone_at_rest.txt", PHONE)
    assert len(recording) == 200
    assert counts(recording) == {}
    assert recording.rate_hz == pytest.approx(198.2, abs=0.5)
    assert np.linalg.norm(recording.raw.mean(axis=0)) / 9.80665 == pytest.approx(0.9936, abs=1e-3)


def test_real_phone_falling() -> None:
    norm_g = np.linalg.norm(read_table(REAL / "phone_falling.txt", PHONE).raw, axis=1) / 9.80665
    assert len(norm_g) == 400
    assert norm_g.min() < 0.11
    assert norm_g.max() == pytest.approx(185.28 / 9.80665, abs=0.01)
