"""Decoding what the FIFO gives: golden vectors, alignment by the x marker, any bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.i2c.adxl355 import decode_counts, split_entries, temperature_c

COUNTS = st.integers(-(1 << 19), (1 << 19) - 1)


def entry(counts: int, *, x: bool = False, empty: bool = False) -> bytes:
    return int((counts & 0xFFFFF) << 4 | empty << 1 | x).to_bytes(3, "big")


def sample(x: int, y: int, z: int) -> bytes:
    return entry(x, x=True) + entry(y) + entry(z)


def test_golden_vectors() -> None:
    assert decode_counts(bytes.fromhex("7ffff1 800000 fffff0 000011 03e800 fc1800")).tolist() == [
        [524287, -524288, -1],
        [1, 16000, -16000],
    ]


@pytest.mark.slow
@given(st.lists(st.tuples(COUNTS, COUNTS, COUNTS), max_size=33))
def test_any_counts_are_decoded(triples: list[tuple[int, int, int]]) -> None:
    runs, tail = split_entries(b"".join(sample(*triple) for triple in triples))
    assert tail == b""
    assert [row for run in runs for row in run.raw.tolist()] == [list(triple) for triple in triples]


@pytest.mark.parametrize(
    ("before", "lost", "after"),
    [
        (entry(8) + entry(9), 1, b""),  # the rest of a sample whose x went elsewhere
        (sample(1, 2, 3) + entry(4, x=True), 1, b""),
        (sample(1, 2, 3) + entry(4, x=True) + entry(5), 1, b""),
        (sample(1, 2, 3) + entry(7), 1, b""),
        (sample(1, 2, 3) + entry(0, empty=True), 0, b""),
        (sample(1, 2, 3), 0, entry(4, x=True)),
        (sample(1, 2, 3), 0, entry(4, x=True) + entry(5)),
        (b"\xff\xff\xff" * 3, 0, b"\xff\xff\xff"),
    ],
)
def test_alignment_is_found_again_at_the_x_marker(before: bytes, lost: int, after: bytes) -> None:
    runs, tail = split_entries(before + sample(10, -11, 12) + sample(13, 14, 15) + after)
    assert runs[-1].raw[-2:].tolist() == [[10, -11, 12], [13, 14, 15]]
    assert sum(run.lost for run in runs) == lost
    assert tail == (b"" if after.startswith(b"\xff") else after)


def test_an_incomplete_end_is_counted_with_the_next_samples() -> None:
    runs, tail = split_entries(sample(1, 2, 3) + entry(4))
    assert [(run.raw.tolist(), run.lost) for run in runs] == [([[1, 2, 3]], 0), ([], 1)]
    assert tail == b""


@pytest.mark.slow
@given(st.binary(max_size=300))
def test_any_bytes_are_decoded_without_an_error(data: bytes) -> None:
    entries = data[: len(data) // 3 * 3]
    runs, tail = split_entries(entries)
    taken = 9 * sum(map(len, runs)) + len(tail)
    assert taken <= len(entries)
    assert all(run.raw.shape == (len(run), 3) for run in runs)


def test_temperature_of_the_data_sheet() -> None:
    assert temperature_c(1885) == 25.0
    assert temperature_c(1885 - 181) == pytest.approx(45.0)
