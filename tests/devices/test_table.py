from dataclasses import replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from devices.errors import RecordingError
from devices.recording import Recording, longest_increasing_mask
from devices.table import read_table
from devices.table_layout import NATIVE, TableLayout

REAL = Path(__file__).parents[1] / "data" / "real"
SIX_POSITION = TableLayout(axes=("acc_x", "acc_y", "acc_z"), unit="counts", rate_hz=204.8, units_per_g=2048)
PHONE = TableLayout(time=1, axes=(2, 3, 4), unit="m/s2", delimiter="\t")
HEADER = "time_s,ax_g,ay_g,az_g"

Delimiter = Literal[",", "\t", " "]


class WriteTable(Protocol):
    """Write lines as a recording, and return its path."""

    def __call__(self, *lines: str, end: str = "\n") -> Path: ...


@pytest.fixture
def table(tmp_path: Path) -> WriteTable:
    def write(*lines: str, end: str = "\n") -> Path:
        path = tmp_path / "recording.csv"
        path.write_text("\n".join(lines) + end)
        return path

    return write


def row(number: int, time_s: float | None = None) -> str:
    return f"{0.02 * number if time_s is None else time_s:.6f},0.{number:03d}0,-0.0100,0.9990"


def rows(count: int) -> list[str]:
    return [row(number) for number in range(count)]


def kept_rows(recording: Recording) -> list[int]:
    """Numbers of the rows that came through, read back from their x axis."""
    numbers: list[int] = np.rint(recording.raw[:, 0] * 1000).astype(int).tolist()
    return numbers


def counts(recording: Recording) -> dict[str, int]:
    names = ("lost", "repeated", "backward", "invalid", "blank", "truncated")
    return {name: getattr(recording, name) for name in names if getattr(recording, name)}


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


@pytest.mark.parametrize(
    ("broken", "kind"),
    [
        ("0.1,nan,0.0,1.0", "invalid"),
        ("nan,0.0,0.0,1.0", "invalid"),
        ("0.1,inf,0.0,1.0", "invalid"),
        ("0.1,0.0,0.0", "invalid"),
        ("0.1,0.0,0.0,1.0,7", "invalid"),
        ("0.1,0.0,,1.0", "invalid"),
        ("0.1,0.0,O.1,1.0", "invalid"),
        ("0.1,0.0,1e300,1.0", "invalid"),
        ("1e300,0.0,0.0,1.0", "invalid"),
        ("0.10,0.0\x7f,0.0,1.0", "invalid"),
        ("0.08,0.0,0.0,1.0", "repeated"),
        ("0.03,0.0,0.0,1.0", "backward"),
        ("-7.0,0.0,0.0,1.0", "backward"),
        ("5000,0.0,0.0,1.0", "backward"),
        ("", "blank"),
        (" \t ", "blank"),
        (",,,", "blank"),
    ],
)
def test_unusable_rows_are_left_out_and_counted_by_kind(table: WriteTable, broken: str, kind: str) -> None:
    whole = rows(10)
    recording = read_table(table(HEADER, *whole[:5], broken, *whole[5:]))
    assert kept_rows(recording) == list(range(10))
    assert counts(recording) == {kind: 1}
    expected = np.zeros(10, dtype=int)
    expected[5] = kind != "blank"
    np.testing.assert_array_equal(recording.unusable_before, expected)


def test_a_gap_is_counted_in_samples_at_its_position(table: WriteTable) -> None:
    whole = rows(20)
    recording = read_table(table(HEADER, *whole[:4], *whole[7:15], *whole[16:]))
    assert counts(recording) == {"lost": 4}
    assert recording.lost_before[4] == 3
    assert recording.lost_before[12] == 1
    assert recording.rate_hz == pytest.approx(50)


@pytest.mark.parametrize("broken", ["nan,nan,nan,nan", "0.10,?,0.0,1.0", "0.01,0.0,0.0,1.0"])
def test_a_row_for_a_missing_sample_is_not_counted_as_lost(table: WriteTable, broken: str) -> None:
    whole = rows(10)
    recording = read_table(table(HEADER, *whole[:5], broken, *whole[6:]))
    assert recording.lost == 0
    assert recording.unusable_before[5] == 1


def test_repeated_row_does_not_explain_a_gap(table: WriteTable) -> None:
    whole = rows(10)
    recording = read_table(table(HEADER, *whole[:5], whole[4], *whole[6:]))
    assert counts(recording) == {"lost": 1, "repeated": 1}


def test_swapped_rows_lose_one_row(table: WriteTable) -> None:
    whole = rows(10)
    whole[4], whole[5] = whole[5], whole[4]
    recording = read_table(table(HEADER, *whole))
    assert len(recording) == 9
    assert counts(recording) == {"backward": 1}


def test_a_clock_set_back_loses_only_the_overlap(table: WriteTable) -> None:
    recording = read_table(
        table(HEADER, *rows(100), *(row(100 + number, 0.02 * (90.5 + number)) for number in range(100)))
    )
    assert len(recording) == 191
    assert counts(recording) == {"backward": 9}


def test_faults_after_the_last_sample_are_counted_with_it(table: WriteTable) -> None:
    recording = read_table(table(HEADER, *rows(4), "x", "y"))
    assert counts(recording) == {"invalid": 2}
    assert recording.unusable_before.tolist() == [0, 0, 0, 2]


@pytest.mark.parametrize(
    ("last", "end", "kept", "kinds"),
    [
        (row(5), "\n", 6, {}),
        (row(5), "", 6, {}),
        (row(5)[:-1], "", 5, {"truncated": 1}),
        (row(5)[:-5], "", 5, {"truncated": 1}),
        (row(5)[:12], "", 5, {"truncated": 1}),
        ("0.1", "", 5, {"truncated": 1}),
    ],
)
def test_an_incomplete_last_line_is_left_out(
    table: WriteTable, last: str, end: str, kept: int, kinds: dict[str, int]
) -> None:
    recording = read_table(table(HEADER, *rows(5), last, end=end))
    assert len(recording) == kept
    assert counts(recording) == kinds


def test_whole_numbers_in_an_unterminated_last_line_are_left_out(table: WriteTable) -> None:
    layout = replace(SIX_POSITION, axes=("x", "y", "z"))
    recording = read_table(table("x,y,z", "1,2,2048", "1,2,2048", "1,2,20", end=""), layout)
    assert recording.raw[:, 2].tolist() == [2048, 2048]
    assert recording.truncated == 1


def test_zeros_at_the_end_after_a_power_failure_are_left_out(table: WriteTable) -> None:
    recording = read_table(table(HEADER, *rows(40), "\0" * 5000, end=""))
    assert len(recording) == 40
    assert counts(recording) == {"truncated": 1}


def test_rows_keep_their_order_over_many_blocks_of_text(table: WriteTable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("devices.table.BLOCK_CHARS", 64)
    whole = rows(50)
    whole[20] = "broken"
    recording = read_table(table("# made by hand", HEADER, *whole))
    assert kept_rows(recording) == [*range(20), *range(21, 50)]
    assert np.flatnonzero(recording.unusable_before).tolist() == [20]


def test_a_line_without_end_is_not_collected(table: WriteTable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("devices.table.BLOCK_CHARS", 64)
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


def test_real_session_by_its_sample_counter_is_refused_for_its_order() -> None:
    """The parts were sorted by name: by the counter, whole faces would fall out."""
    with pytest.raises(
        RecordingError, match=r"six_position_session.csv: .* goes back in 150 of 300 rows; check its time"
    ):
        read_table(REAL / "six_position_session.csv", replace(SIX_POSITION, time="samples"))


def test_real_phone_at_rest() -> None:
    recording = read_table(REAL / "phone_at_rest.txt", PHONE)
    assert len(recording) == 200
    assert counts(recording) == {}
    assert recording.rate_hz == pytest.approx(198.2, abs=0.5)
    assert np.linalg.norm(recording.raw.mean(axis=0)) == pytest.approx(0.9936, abs=1e-3)


def test_real_phone_falling() -> None:
    norm_g = np.linalg.norm(read_table(REAL / "phone_falling.txt", PHONE).raw, axis=1)
    assert len(norm_g) == 400
    assert norm_g.min() < 0.11
    assert norm_g.max() == pytest.approx(185.28 / 9.80665, abs=0.01)


@pytest.mark.parametrize(
    ("content", "layout", "message"),
    [
        (b"", NATIVE, "is empty; choose another recording"),
        (b" \n\n", NATIVE, "is empty; choose another recording"),
        (b"\xef\xbb\xbf", NATIVE, "is empty; choose another recording"),
        (b"\x89MCAP0\r\n\x00\x01", NATIVE, "is not UTF-8 text"),
        ("time_s,ax_g\n0,1\n".encode("utf-16"), NATIVE, "is not UTF-8 text"),
        (
            b"t,x,y,z\n0,0,0,1\n",
            NATIVE,
            "no header with the columns time_s, ax_g, ay_g, az_g; its first line has: t, x, y, z",
        ),
        (b"0,0,0,1\n0.1,0,0,1\n", NATIVE, "no header with the columns"),
        (b"time_s,ax_g,ay_g,az_g,ax_g\n0,0,0,1,0\n", NATIVE, "column ax_g occurs twice in its header"),
        (b"time_s,ax_g,ay_g,az_g\n", NATIVE, "no two usable samples in 0 rows; check its columns"),
        (b"time_s,ax_g,ay_g,az_g", NATIVE, "no two usable samples in 0 rows"),
        (b"time_s,ax_g,ay_g,az_g\n0,0,0,1\n1,nan,0,1\n", NATIVE, "no two usable samples in 2 rows"),
        (b"time_s,ax_g,ay_g,az_g\n0;0;0;1\n1;0;0;1\n", NATIVE, "no two usable samples in 2 rows"),
        (
            b"time_s,ax_g,ay_g,az_g\n3,0,0,1\n2,0,0,1\n1,0,0,1\n",
            NATIVE,
            "time repeats in 0 and goes back in 2 of 3 rows; check its time column",
        ),
        (b"0,0,1\n", PHONE, "no line with numbers in the columns 1, 2, 3, 4; its first line has 1: 0,0,1"),
        (b"0,0,1\n", TableLayout(axes=(1, 2, 3), rate_hz=100), 'unit of its axis columns is not given; say "g"'),
        (b"0,0,1\n", TableLayout(axes=(1, 2, 3), unit="g"), "neither a time column nor a sample rate is given"),
        (b"0,0,1\n", TableLayout(axes=(1, 2, 3), unit="g", rate_hz=0), "a rate of 0 Hz is impossible"),
        (b"0,0,1\n", TableLayout(axes=(0, 1, 2), unit="g", rate_hz=1), "a column number below 1"),
        (b"0,0,1\n", TableLayout(time="t", axes=(0, 1, 2), unit="g"), "columns are given by name and by number"),
    ],
)
def test_a_file_that_is_not_a_recording_is_refused_in_one_line(
    tmp_path: Path, content: bytes, layout: TableLayout, message: str
) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(RecordingError) as refusal:
        read_table(path, layout)
    text = str(refusal.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert text.isprintable()


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone\.csv: no such file; check the path"):
        read_table(tmp_path / "gone.csv")
    with pytest.raises(RecordingError, match="is a directory; name the recording in it"):
        read_table(tmp_path)


@pytest.mark.parametrize(
    ("error", "message"), [(PermissionError(13, "no"), "may not be read"), (OSError(5, "I/O"), "cannot be read")]
)
def test_a_file_that_cannot_be_read_is_reported(
    table: WriteTable, monkeypatch: pytest.MonkeyPatch, error: OSError | PermissionError, message: str
) -> None:
    path = table(HEADER, *rows(3))

    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("os.open", refuse)
    with pytest.raises(RecordingError, match=message):
        read_table(path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.binary(max_size=400),
    head=st.sampled_from([b"", b"time_s,ax_g,ay_g,az_g,temperature_c\n0,0,0,1,20\n1,0,0,1,20\n"]),
)
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes, head: bytes) -> None:
    path = tmp_path / "fuzz.csv"
    path.write_bytes(head + data)
    try:
        recording = read_table(path)
    except RecordingError:
        return
    assert np.isfinite(recording.raw).all()
    assert (np.diff(recording.offset_ns()) > 0).all()


LINES = st.lists(st.sampled_from(["ok", "nan", "short", "blank", "same", "back", "skip"]), min_size=5, max_size=80)


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kinds=LINES)
def test_every_row_is_accounted_for(tmp_path: Path, kinds: list[str]) -> None:
    """Each line is used or counted once, and those that are used are whole."""
    kinds = [*kinds, *["ok"] * 250]  # so many that the times make an order
    time_s, lines = 0.0, []
    for kind in kinds:
        time_s += {"skip": 0.06, "same": 0.0, "blank": 0.0}.get(kind, 0.02)
        text = {
            "nan": f"{time_s:.3f},nan,0,1",
            "short": f"{time_s:.3f},0",
            "blank": "",
            "back": f"{time_s - 0.033:.3f},0,0,1",
        }
        lines.append(text.get(kind, f"{time_s:.3f},0,0,1"))
    path = tmp_path / "recording.csv"
    path.write_text("\n".join([HEADER, *lines, ""]))
    recording = read_table(path)
    assert recording.blank == kinds.count("blank")
    assert recording.invalid == kinds.count("nan") + kinds.count("short")
    unusable = recording.invalid + recording.repeated + recording.backward
    assert len(recording) + unusable + recording.blank == len(kinds)
    assert recording.unusable_before.sum() == unusable
    assert (recording.lost_before >= 0).all()


@given(st.lists(st.integers(-8, 8), min_size=1, max_size=12))
def test_the_longest_increasing_subsequence_leaves_out_the_fewest(times: list[int]) -> None:
    mask = longest_increasing_mask(np.array(times, dtype=np.int64))
    assert (np.diff(np.array(times)[mask]) > 0).all()
    longest = [1] * len(times)
    for later, time in enumerate(times):
        longest[later] = 1 + max((longest[earlier] for earlier in range(later) if times[earlier] < time), default=0)
    assert mask.sum() == max(longest)
