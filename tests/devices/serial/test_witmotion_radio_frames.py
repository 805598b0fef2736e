"""Frames of a Bluetooth sensor out of a stream of bytes, whatever happens to it."""

import math
from itertools import chain, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.serial.witmotion_radio_frames import FRAME_BYTES, LOCK_FRAMES, RAD_S_PER_UNIT, RadioFrameDecoder
from tests.devices.serial.witmotion_wire import NOISE, numbers_of, radio_answer, radio_frame, radio_sample, radio_stream

END = b"\x55\x61"
"""The header of the frame that follows, without which the last one is not used."""


def test_words_are_those_of_the_protocol() -> None:
    """16 g, 2000 deg/s and 180 deg are 32768 each (WT901BLE protocol, data packet)."""
    readings = RadioFrameDecoder().feed(radio_frame(-32768, 2048, 32767, 16384, -16384, 1, 0, 0, 0) * 3 + END)
    assert readings.counts[0].tolist() == [-32768, 2048, 32767]
    assert readings.counts.dtype == np.int32
    assert readings.gyro_counts is not None
    assert (readings.gyro_counts[0, :2] * RAD_S_PER_UNIT).tolist() == pytest.approx(
        [math.radians(1000), -math.radians(1000)]
    )
    assert np.isnan(readings.temperature_c).all()


@pytest.mark.parametrize("size", [1, 2, 7, 19, 20, 21, 100])
def test_frames_are_decoded_from_pieces_of_any_length(size: int) -> None:
    decoder = RadioFrameDecoder()
    data = radio_stream(range(30)) + END
    found = [number for at in range(0, len(data), size) for number in numbers_of(decoder.feed(data[at : at + size]))]
    assert found == list(range(30))
    assert set(decoder.faults.values()) == {0}


def test_a_frame_is_used_when_the_header_of_the_next_has_arrived() -> None:
    decoder = RadioFrameDecoder()
    assert numbers_of(decoder.feed(radio_stream(range(5)))) == [0, 1, 2, 3]
    assert decoder.bytes_until(2) == FRAME_BYTES + 2
    assert numbers_of(decoder.feed(END)) == [4]


@pytest.mark.parametrize("cut", range(1, FRAME_BYTES))
def test_stream_joined_in_the_middle_of_a_frame(cut: int) -> None:
    decoder = RadioFrameDecoder()
    readings = decoder.feed(radio_stream(range(10))[cut:] + END)
    assert numbers_of(readings) == list(range(1, 10))
    assert not readings.missing_before.any()
    assert decoder.faults["discarded_bytes"] == FRAME_BYTES - cut


@pytest.mark.parametrize("gone", range(1, FRAME_BYTES - 1))
def test_lost_bytes_lose_only_their_frame(gone: int) -> None:
    decoder = RadioFrameDecoder()
    data = radio_stream(range(6)) + radio_sample(6)[: FRAME_BYTES - gone] + radio_stream(range(7, 12)) + END
    readings = decoder.feed(data)
    assert numbers_of(readings) == [0, 1, 2, 3, 4, 5, *range(7, 12)]
    assert decoder.faults["header"] == 1
    if gone < FRAME_BYTES / 2:
        assert readings.invalid_before[6] == 1


@pytest.mark.parametrize("count", [1, 5, 19, 20, 41, 200])
def test_additional_bytes_lose_at_most_the_frame_before_them(count: int) -> None:
    """What was not followed by a header may be the frame with the additional bytes in it."""
    readings = RadioFrameDecoder().feed(radio_stream(range(6)) + NOISE[:count] + radio_stream(range(6, 12)) + END)
    assert numbers_of(readings) == [0, 1, 2, 3, 4, *range(6, 12)]


def test_a_flipped_bit_in_a_header_loses_two_frames() -> None:
    for bit in range(16):
        data = bytearray(radio_stream(range(12)) + END)
        data[5 * FRAME_BYTES + bit // 8] ^= 1 << bit % 8
        lost = (5,) if bit == 12 else (4, 5)  # bit 12 makes it the header of an answer
        decoder = RadioFrameDecoder()
        assert numbers_of(decoder.feed(bytes(data))) == [number for number in range(12) if number not in lost]


def test_answers_are_kept_and_are_no_readings() -> None:
    decoder = RadioFrameDecoder()
    data = (
        radio_stream(range(3)) + radio_answer(0x40, 2512, 7) + radio_stream(range(3, 5)) + radio_answer(0x64, 391) + END
    )
    assert numbers_of(decoder.feed(data)) == list(range(5))
    assert decoder.registers == {0x40: 2512, 0x64: 391}
    decoder.reset()
    assert decoder.registers == {}


PIECES = st.lists(
    st.one_of(
        st.binary(max_size=60),
        st.integers(0, 30000).map(radio_sample),
        st.integers(0, 30000).map(lambda number: radio_answer(number, number)),
        st.just(END * 20),
        st.just(b"\x55" * 40),
        st.integers(0, 30000).map(lambda number: radio_sample(number)[: number % FRAME_BYTES]),
    ),
    max_size=40,
)


@pytest.mark.slow
@settings(max_examples=200)
@given(PIECES)
def test_any_bytes_are_decoded_or_counted_and_none_are_kept(pieces: list[bytes]) -> None:
    decoder, whole = RadioFrameDecoder(), RadioFrameDecoder()
    found = [decoder.feed(piece) for piece in pieces]
    everything = whole.feed(b"".join(pieces))
    assert list(chain.from_iterable(numbers_of(readings) for readings in found)) == numbers_of(everything)
    assert decoder.faults == whole.faults
    assert decoder.registers == whole.registers
    assert len(decoder._buffer) < LOCK_FRAMES * FRAME_BYTES
    sent = sum(len(piece) for piece in pieces)
    assert len(everything) * FRAME_BYTES + decoder.faults["discarded_bytes"] <= sent


@pytest.mark.slow
@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(3, 10), st.binary(max_size=50)), max_size=8))
def test_no_sample_is_invented(disturbances: list[tuple[int, bytes]]) -> None:
    data, number = b"", 1
    for count, garbage in disturbances:
        data += radio_stream(range(number, number + count)) + garbage.replace(b"\x55", b"")
        number += count
    data += radio_stream(range(number, number + 5)) + END
    found = numbers_of(RadioFrameDecoder().feed(data))
    assert found[-5:] == list(range(number, number + 5))
    assert all(earlier < later for earlier, later in pairwise(found))
    assert set(found) <= set(range(1, number + 5))
