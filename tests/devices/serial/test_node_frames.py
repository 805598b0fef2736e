"""The frames of a node: the reference encoder in C and this decoder agree, and damaged frames are refused."""

import binascii
import re
import shutil
import struct
import subprocess
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.serial.node_frames import MAX_ENCODED_BYTES, NodeFrameDecoder, NodeFrameError, decode_frame, encode_frame
from tests.devices.serial.node_wire import Node

ROOT = Path(__file__).parents[3]
VECTORS = ROOT / "tests" / "data" / "node_vectors.txt"
DOCUMENT = (ROOT / "docs" / "guides" / "integrator" / "node.md").read_text()


def vectors() -> list[bytes]:
    return [bytes.fromhex(line) for line in VECTORS.read_text().split()]


def test_check_value_of_the_checksum() -> None:
    """CRC-16/CCITT-FALSE in the catalogue of parametrised CRC algorithms."""
    assert binascii.crc_hqx(b"123456789", 0xFFFF) == 0x29B1
    assert "0x29B1" in DOCUMENT


@pytest.mark.slow
def test_the_kept_vectors_are_those_of_the_c_encoder(tmp_path: Path) -> None:
    """Without a compiler the kept vectors still check the decoder; with one, the encoder is compiled and run."""
    compiler = shutil.which("cc")
    if compiler is not None:
        source = ROOT / "tests" / "devices" / "serial" / "node_vectors.c"
        options = [
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
            f"-I{ROOT / 'docs' / 'guides' / 'integrator' / 'node'}",
        ]
        subprocess.run([compiler, *options, str(source), "-o", str(tmp_path / "vectors")], check=True)
        written = subprocess.run([str(tmp_path / "vectors")], check=True, capture_output=True, text=True).stdout
        assert written == VECTORS.read_text()
    assert len(vectors()) == 203


def test_every_vector_is_decoded_and_encoded_to_the_same_bytes() -> None:
    decoder = NodeFrameDecoder()
    frames = decoder.feed(b"".join(vectors()))
    assert len(frames) == 203
    assert [encode_frame(frame) for frame in frames] == vectors()
    assert set(decoder.faults.values()) == {0}


def test_worked_example_of_the_document() -> None:
    """Decoded with nothing but the offsets of the table."""
    example = bytes.fromhex(" ".join(re.findall(r"^    ((?:[0-9A-F]{2} ?)+)$", DOCUMENT, flags=re.M)))
    assert example == vectors()[0]
    frame = decode_frame(example[:-1])
    assert (frame.node, frame.boot, frame.sequence, frame.t_us, frame.scale_ng) == (7, 3, 1000, 12_500_000, 61035)
    assert (frame.full_scale, frame.temperature_c, frame.battery_v, frame.signal_dbm) == (32767, 21.5, 3.712, -67.0)
    assert frame.counts.tolist() == [[0, 0, 16384], [-82, 41, 16380]]
    assert not frame.battery_low


def test_extremes_of_the_second_vector() -> None:
    frame = decode_frame(vectors()[1][:-1])
    assert (frame.node, frame.sequence, frame.t_us) == (2**32 - 1, 2**32 - 1, 2**64 - 1)
    assert (frame.battery_low, frame.signal_dbm, frame.temperature_c) == (True, -128.0, -21.5)
    assert frame.counts.tolist() == [[-23131] * 3] * 40
    unknown = decode_frame(vectors()[2][:-1])
    assert (unknown.battery_v, unknown.signal_dbm, unknown.temperature_c) == (None, None, None)


@pytest.mark.slow
def test_every_flipped_bit_is_found() -> None:
    for bit in range(8 * (len(vectors()[0]) - 1)):
        data = bytearray(vectors()[0][:-1])
        data[bit // 8] ^= 1 << bit % 8
        with pytest.raises(NodeFrameError):
            decode_frame(bytes(data))


def repacked(offset: int, form: str, value: int, data: bytes = b"") -> bytes:
    """Return the example with another field and a right checksum, not stuffed with more than one code."""
    from devices.serial.node_frames import cobs_decode, cobs_encode  # noqa: PLC0415

    raw = bytearray(cobs_decode(vectors()[0][:-1])[:-2] + data)
    struct.pack_into(form, raw, offset, value)
    return cobs_encode(bytes(raw) + struct.pack("<H", binascii.crc_hqx(bytes(raw), 0xFFFF)))


@pytest.mark.parametrize(
    ("encoded", "fault"),
    [
        (repacked(0, "<B", 2), "version"),
        (repacked(31, "<B", 0), "length"),
        (repacked(31, "<B", 1), "length"),
        (repacked(31, "<B", 41), "length"),
        (repacked(12, "<I", 0), "length"),  # a scale of 0 would make every reading 0
        (repacked(24, "<H", 0), "length"),
        (repacked(31, "<B", 2, b"\1"), "length"),
        (b"\x03\x01\x02", "length"),
        (b"\x09\x01", "stuffing"),
    ],
)
def test_a_frame_that_makes_no_sense_is_refused(encoded: bytes, fault: str) -> None:
    with pytest.raises(NodeFrameError) as error:
        decode_frame(encoded)
    assert error.value.fault == fault


def test_joining_in_the_middle_of_a_frame_is_no_fault() -> None:
    decoder = NodeFrameDecoder()
    data = Node().frames(3)
    assert [frame.sequence for frame in decoder.feed(data[20:])] == [5, 10]
    assert set(decoder.faults.values()) == {0}
    decoder.reset()
    assert [frame.sequence for frame in decoder.feed(data[30:])] == [5, 10]
    assert set(decoder.faults.values()) == {0}


def test_bytes_without_a_delimiter_are_not_kept() -> None:
    decoder = NodeFrameDecoder()
    for _ in range(10):
        assert decoder.feed(b"\x55" * 1000) == []
    assert len(decoder._buffer) <= MAX_ENCODED_BYTES
    assert decoder.bytes_since_frame >= 9000
    node = Node()
    assert [frame.sequence for frame in decoder.feed(node.frames(2))][-1] == 5
    assert decoder.bytes_since_frame == 0


PIECES = st.lists(
    st.one_of(
        st.binary(max_size=80),
        st.integers(0, 1000).map(lambda number: Node(boot=number).frame(1 + number % 40)),
        st.integers(0, 1000).map(lambda number: Node(boot=number).frame(3)[: number % 60]),
        st.just(b"\0" * 5),
        st.just(b"\xff" * 300),
    ),
    max_size=30,
)


@pytest.mark.slow
@settings(max_examples=200)
@given(PIECES)
def test_any_bytes_are_decoded_or_counted_and_none_are_kept(pieces: list[bytes]) -> None:
    decoder = NodeFrameDecoder()
    found = list(chain.from_iterable(decoder.feed(piece) for piece in pieces))
    assert len(decoder._buffer) <= MAX_ENCODED_BYTES
    for frame in found:
        assert 1 <= len(frame.counts) <= 40
        assert np.isfinite(frame.counts * (frame.scale_ng * 1e-9)).all()
    node = Node()
    assert [frame.boot for frame in decoder.feed(b"\0" + node.frame())][-1:] == [1]
