import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from devices.block import SampleBlock
from gateway import messages, topics
from gateway.packing import pack, unpack
from gateway.recording.format.content import encode_recorded
from tests.gateway.conftest import make_block, make_samples


def packed(block: SampleBlock) -> messages.Samples:
    return pack(block, time_ns=int(block.time_ns[-1]), clock="replayed", sequence=3, calibration_id=None)


def through_json(block: SampleBlock) -> SampleBlock:
    data = topics.encode(packed(block))
    return unpack(topics.adapter("samples").validate_json(data))


def assert_same(block: SampleBlock, back: SampleBlock) -> None:
    assert back.time_ns.dtype == np.int64
    assert back.raw.dtype == block.raw.dtype
    np.testing.assert_array_equal(back.time_ns, block.time_ns)
    assert back.raw.tobytes() == np.ascontiguousarray(block.raw).tobytes()  # bits: -0.0 is not 0.0
    assert (back.temperature_c, back.lost, back.invalid) == (block.temperature_c, block.lost, block.invalid)
    assert (back.gyro_counts is None) == (block.gyro_counts is None)
    if block.gyro_counts is not None and back.gyro_counts is not None:
        assert back.gyro_counts.dtype == np.int32
        np.testing.assert_array_equal(back.gyro_counts, block.gyro_counts)
    if block.saturated is None or back.saturated is None:
        assert back.saturated is block.saturated
    else:
        assert back.saturated.dtype == np.bool_
        np.testing.assert_array_equal(back.saturated, block.saturated)


@st.composite
def times(draw: st.DrawFn, length: int) -> NDArray[np.int64]:
    first_ns = draw(st.integers(0, 2**62))
    if draw(st.booleans()):
        period_ns = draw(st.floats(1, 1e10))
        regular_ns: NDArray[np.int64] = first_ns + np.rint(np.arange(length) * period_ns).astype(np.int64)
        return regular_ns
    steps_ns = draw(st.lists(st.integers(1, 10**13), min_size=length - 1, max_size=length - 1))
    return first_ns + np.cumsum([0, *steps_ns], dtype=np.int64)


@st.composite
def blocks(draw: st.DrawFn) -> SampleBlock:
    length = draw(st.integers(1, 40))
    full_range = st.integers(-(2**31), 2**31 - 1)
    finite = st.floats(allow_nan=False, allow_infinity=False)
    raw = draw(
        npst.arrays(np.int32, (length, 3), elements=full_range) | npst.arrays(np.float64, (length, 3), elements=finite)
    )
    temperature_c = draw(st.none() | st.floats(-40, 125))
    saturated = draw(st.none() | npst.arrays(np.bool_, length))
    gyro_counts = draw(st.none() | npst.arrays(np.int32, (length, 3), elements=full_range))
    return SampleBlock(
        draw(times(length)),
        raw,
        temperature_c,
        draw(st.integers(0, 10**6)),
        draw(st.integers(0, 9)),
        saturated=saturated,
        gyro_counts=gyro_counts,
    )


@pytest.mark.slow
@given(blocks())
def test_a_block_is_unpacked_exactly(block: SampleBlock) -> None:
    assert_same(block, through_json(block))


def test_even_times_become_a_period_and_uneven_ones_offsets() -> None:
    even = packed(make_block(period_ns=1_000_123.456))
    assert even.offsets_ns is None
    assert even.period_ns == pytest.approx(1_000_123.456, abs=0.05)
    block = make_block()
    time_ns = block.time_ns.copy()
    time_ns[5] += 3
    uneven = packed(SampleBlock(time_ns, block.raw))
    assert uneven.period_ns is None
    assert uneven.offsets_ns == (time_ns[1:] - time_ns[0]).tolist()


@pytest.mark.slow
@given(st.floats(2, 1e10), st.integers(2, 200))
def test_every_even_block_has_the_short_form(period_ns: float, length: int) -> None:
    exact_ns = np.arange(length) * period_ns
    # Exact halves, rounded to even, may leave a single period that no sum of floats meets: those keep their offsets.
    assume(not np.any(np.abs(exact_ns % 1 - 0.5) < 1e-3))
    time_ns = 10**18 + np.rint(exact_ns).astype(np.int64)
    assert packed(SampleBlock(time_ns, np.zeros((length, 3), np.int32))).offsets_ns is None


def test_counts_are_whole_numbers_and_g_has_every_digit() -> None:
    counts = SampleBlock(np.array([5, 10]), np.array([[1, 2, 256000], [0, 2, 256003]], np.int32))
    content = json.loads(topics.encode(packed(counts)))
    assert content["z"] == [256000, 3]
    assert b'"z":[256000,3]' in topics.encode(packed(counts))
    readings_g = SampleBlock(np.array([5]), np.array([[0.1 + 0.2, 1.0, -1e-17]]))
    assert b'"x":[0.30000000000000004],"y":[1.0],"z":[-1e-17]' in topics.encode(packed(readings_g))


def test_marks_of_saturation_cost_a_few_bytes_where_nothing_saturates() -> None:
    block = make_block()
    unmarked = len(encode_recorded(packed(block)))
    marked = replace(block, saturated=np.zeros(len(block), dtype=np.bool_))
    assert len(encode_recorded(packed(marked))) - unmarked <= len(',"saturated":[]')


@pytest.mark.parametrize("places", [[-1], [0, 32]])
def test_a_mark_outside_the_block_is_refused(places: list[int]) -> None:
    with pytest.raises(ValueError, match="saturated samples"):
        unpack(replace(packed(make_block()), saturated=places))


@pytest.mark.parametrize("reading", [np.nan, np.inf])
def test_a_reading_that_is_not_finite_is_refused(reading: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        packed(SampleBlock(np.array([5]), np.array([[0.0, reading, 1.0]])))


def test_an_empty_block_is_refused() -> None:
    with pytest.raises(ValueError, match="without samples"):
        pack(
            SampleBlock(np.array([], np.int64), np.empty((0, 3), np.int32)),
            time_ns=0,
            clock="replayed",
            sequence=0,
            calibration_id=None,
        )


@pytest.mark.parametrize(
    "change",
    [
        {"y": [1]},
        {"x": [], "y": [], "z": []},
        {"period_ns": None, "offsets_ns": [1]},
        {"period_ns": 1e300},
        {"period_ns": float("nan")},
        {"first_log_time_ns": 2**64},
        {"z": [2**70, 1, 2, 3]},
    ],
)
def test_columns_of_different_lengths_are_refused(change: dict[str, object]) -> None:
    content = {**topics.adapter("samples").dump_python(make_samples(length=4)), **change}
    with pytest.raises(ValueError, match=r"samples|64 bits"):
        unpack(messages.Samples(**content))
