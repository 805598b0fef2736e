"""Decoding of three 16-bit numbers per sample: golden vectors, samples of ones, any bytes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from devices.i2c.accelerometer_chip import SAMPLE_BYTES, decode_samples

ONES = b"\xff" * SAMPLE_BYTES
GOOD = bytes.fromhex("0100 feff 0080")


def test_golden_vectors() -> None:
    (run,) = decode_samples(GOOD)
    assert run.raw.tolist() == [[1, -2, -32768]]
    assert decode_samples(bytes.fromhex("1000 f0ff 0080"), shift=4)[0].raw.tolist() == [[1, -1, -2048]]


def test_samples_of_ones_are_lost_and_counted_where_they_were() -> None:
    runs = decode_samples(ONES + GOOD + GOOD + ONES + ONES + GOOD + ONES)
    assert [(len(run), run.lost) for run in runs] == [(2, 1), (1, 2), (0, 1)]


def test_no_bytes_are_no_samples() -> None:
    assert decode_samples(b"") == []


@given(st.binary(max_size=200), st.integers(0, 4))
def test_any_bytes_are_decoded_and_every_sample_is_accounted_for(data: bytes, shift: int) -> None:
    whole = data[: len(data) // SAMPLE_BYTES * SAMPLE_BYTES]
    runs = decode_samples(whole, shift)
    assert sum(len(run) + run.lost for run in runs) == len(whole) // SAMPLE_BYTES
    assert all(run.raw.dtype == np.int32 and run.raw.shape[1] == 3 for run in runs)
