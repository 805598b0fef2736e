"""Rows that cannot be used are left out and counted by kind, and no row is lost uncounted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from devices.recording import longest_increasing_mask
from devices.tables.native import read_table
from tests.devices.tables.table_lines import HEADER, SIX_POSITION, WriteTable, counts, kept_rows, row, rows


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


LINES = st.lists(st.sampled_from(["ok", "nan", "short", "blank", "same", "back", "skip"]), min_size=5, max_size=80)


@pytest.mark.slow
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


@pytest.mark.slow
@given(st.lists(st.integers(-8, 8), min_size=1, max_size=12))
def test_the_longest_increasing_subsequence_leaves_out_the_fewest(times: list[int]) -> None:
    mask = longest_increasing_mask(np.array(times, dtype=np.int64))
    assert (np.diff(np.array(times)[mask]) > 0).all()
    longest = [1] * len(times)
    for later, time in enumerate(times):
        longest[later] = 1 + max((longest[earlier] for earlier in range(later) if times[earlier] < time), default=0)
    assert mask.sum() == max(longest)
