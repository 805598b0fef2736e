"""Frames out of a stream of bytes, whatever happens to it."""

from itertools import chain, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.serial.witmotion_frames import FRAME_BYTES, FrameDecoder
from tests.devices.serial.witmotion_wire import GOLDEN, NOISE, cycle, frame, numbers_of, sample, stream


def test_golden_vector() -> None:
    readings = FrameDecoder().feed(GOLDEN * 2)
    assert readings.counts.tolist() == [[0, 0, 2048]] * 2
    assert readings.counts.dtype == np.int32
    assert readings.temperature_c.tolist() == [25.0] * 2


def test_words_are_signed() -> None:
    decoder = FrameDecoder()
    readings = decoder.feed(frame(0x51, -32768, 32767, -1, -1050) * 2)
    assert readings.counts[0].tolist() == [-32768, 32767, -1]
    assert readings.temperature_c[0] == -10.5


def test_one_valid_frame_does_not_synchronise_the_decoder() -> None:
    decoder = FrameDecoder()
    assert len(decoder.feed(sample(1))) == 0
    assert len(decoder.feed(NOISE[:11].replace(b"\x55", b"\x54"))) == 0
    assert decoder.faults["false_start"] == 1


@pytest.mark.parametrize("size", [1, 2, 5, 7, 11, 13, 100])
def test_frames_are_decoded_from_pieces_of_any_length(size: int) -> None:
    decoder = FrameDecoder()
    data = stream(range(30))
    found = [number for at in range(0, len(data), size) for number in numbers_of(decoder.feed(data[at : at + size]))]
    assert found == list(range(30))
    assert set(decoder.faults.values()) == {0}


@pytest.mark.parametrize("cut", range(1, 11))
def test_stream_joined_in_the_middle_of_a_frame(cut: int) -> None:
    decoder = FrameDecoder()
    assert numbers_of(decoder.feed(stream(range(10))[cut:])) == list(range(1, 10))
    assert decoder.faults["discarded_bytes"] == FRAME_BYTES - cut


def test_other_standard_frames_are_skipped() -> None:
    decoder = FrameDecoder()
    readings = decoder.feed(b"".join(cycle(number) for number in range(20)))
    assert numbers_of(readings) == list(range(20))
    assert set(decoder.faults.values()) == {0}
    assert not readings.missing_before.any()


def test_frames_with_a_non_standard_id_are_invalid() -> None:
    decoder = FrameDecoder()
    assert len(decoder.feed(frame(0x61, 1, 2, 3, 4) * 5)) == 0
    assert decoder.faults["discarded_bytes"] >= 4 * FRAME_BYTES
    among = FrameDecoder()
    among.feed(stream(range(5)) + frame(0x61, 1, 2, 3, 4) + stream(range(5, 10)))
    assert among.faults["checksum"] == 1


def test_a_flipped_bit_loses_only_its_frame() -> None:
    for bit in range(8 * FRAME_BYTES):
        decoder = FrameDecoder()
        data = bytearray(stream(range(10)))
        data[5 * FRAME_BYTES + bit // 8] ^= 1 << bit % 8
        readings = decoder.feed(bytes(data))
        assert numbers_of(readings) == [0, 1, 2, 3, 4, 6, 7, 8, 9]
        assert readings.invalid_before.tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 0]
        assert readings.lost_before.sum() == 0
        assert decoder.faults == {"checksum": 1, "false_start": 0, "discarded_bytes": FRAME_BYTES}


@pytest.mark.parametrize("gone", range(1, 11))
def test_lost_bytes_lose_only_their_frame(gone: int) -> None:
    decoder = FrameDecoder()
    readings = decoder.feed(stream(range(6)) + sample(6)[gone:] + stream(range(7, 12)))
    assert numbers_of(readings) == [0, 1, 2, 3, 4, 5, *range(7, 12)]
    assert decoder.faults["discarded_bytes"] == FRAME_BYTES - gone
    if gone <= 5:  # beyond it the hole is nearer to no frame than to one
        assert readings.missing_before[6] == 1


@pytest.mark.parametrize("count", [1, 5, 10, 12, 200])
def test_bytes_between_frames_lose_no_frame(count: int) -> None:
    decoder = FrameDecoder()
    readings = decoder.feed(stream(range(6)) + NOISE[:count] + stream(range(6, 12)))
    assert numbers_of(readings) == list(range(12))
    assert decoder.faults["discarded_bytes"] == count


@pytest.mark.parametrize("count", range(1, 8))
def test_missing_samples_are_counted_by_the_missing_bytes(count: int) -> None:
    data = [cycle(number) for number in range(30)]
    data[10 : 10 + count] = [bytes(len(entry)) for entry in data[10 : 10 + count]]
    readings = FrameDecoder().feed(b"".join(data))
    assert numbers_of(readings) == [*range(10), *range(10 + count, 30)]
    assert readings.missing_before[10] == count
    assert readings.missing_before.sum() == count


def test_a_damaged_frame_of_another_kind_loses_no_sample() -> None:
    data = [cycle(number) for number in range(20)]
    data[10] = data[10][:20] + b"\xff" + data[10][21:]
    decoder = FrameDecoder()
    readings = decoder.feed(b"".join(data))
    assert numbers_of(readings) == list(range(20))
    assert decoder.faults["checksum"] == 1
    assert not readings.missing_before.any()


def test_a_reply_between_frames_is_not_a_loss() -> None:
    decoder = FrameDecoder()
    readings = decoder.feed(stream(range(10)) + frame(0x5F, 1, 2, 3, 4) + stream(range(10, 20)))
    assert numbers_of(readings) == list(range(20))
    assert not readings.missing_before.any()


def test_a_reset_keeps_the_counters_and_reports_no_loss() -> None:
    decoder = FrameDecoder()
    decoder.feed(stream(range(10)) + NOISE[:50] + sample(10)[:5])
    decoder.reset()
    readings = decoder.feed(stream(range(100, 110)))
    assert numbers_of(readings) == list(range(100, 110))
    assert not readings.missing_before.any()
    assert decoder.faults["discarded_bytes"] == 50


PIECES = st.lists(
    st.one_of(
        st.binary(max_size=60),
        st.integers(0, 30000).map(sample),
        st.integers(0, 30000).map(cycle),
        st.just(GOLDEN * 3),
        st.just(b"\x55" * 40),
        st.integers(0, 30000).map(lambda number: sample(number)[: number % FRAME_BYTES]),
    ),
    max_size=40,
)


@pytest.mark.slow
@settings(max_examples=300)
@given(PIECES)
def test_any_bytes_are_decoded_or_counted_and_none_are_kept(pieces: list[bytes]) -> None:
    decoder, whole = FrameDecoder(), FrameDecoder()
    found = [decoder.feed(piece) for piece in pieces]
    everything = whole.feed(b"".join(pieces))
    assert list(chain.from_iterable(numbers_of(readings) for readings in found)) == numbers_of(everything)
    missing = list(chain.from_iterable(readings.missing_before.tolist() for readings in found))
    assert missing == everything.missing_before.tolist()
    assert decoder.faults == whole.faults
    sent = sum(len(piece) for piece in pieces)
    assert len(everything) * FRAME_BYTES + decoder.faults["discarded_bytes"] <= sent
    assert len(decoder._buffer) < 2 * FRAME_BYTES
    assert (everything.lost_before >= 0).all()


@pytest.mark.slow
@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 10), st.binary(max_size=30)), max_size=8))
def test_no_sample_is_invented(disturbances: list[tuple[int, bytes]]) -> None:
    """Whatever stands between the frames, what comes out was sent, in its order, and a clean end is found again."""
    data, number = b"", 1
    for count, garbage in disturbances:
        data += stream(range(number, number + count)) + garbage.replace(b"\x55", b"")
        number += count
    data += stream(range(number, number + 5))
    found = numbers_of(FrameDecoder().feed(data))
    assert found[-5:] == list(range(number, number + 5))
    assert all(earlier < later for earlier, later in pairwise(found))
    assert set(found) <= set(range(1, number + 5))
