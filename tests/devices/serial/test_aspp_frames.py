"""Packets of a base station out of a stream of bytes, whatever happens to it."""

import zlib
from itertools import chain

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.serial.aspp_frames import (
    LAYOUTS,
    MAX_ASPP_PAYLOAD_BYTES,
    AsppDecoder,
    Diagnostic,
    fletcher16,
    read_diagnostic,
    read_sweeps,
)
from tests.devices.serial.aspp_wire import AsppNode, diagnostic_payload, packet, sweep_payload
from tests.devices.serial.witmotion_wire import NOISE
from tests.values import present

VERSIONS = (1, 2, 3)


def test_check_values_of_the_checksums() -> None:
    """`Test_ByteStream.cpp` of MSCL has the first, the catalogue of parametrised CRC algorithms (CRC-32/ISO-HDLC) the second."""
    assert fletcher16(bytes.fromhex("12345678")) == 5128
    assert zlib.crc32(b"123456789") == 0xCBF43926


def test_a_packet_of_version_1_from_the_maker_s_tests() -> None:
    """`Test_WirelessParser.cpp`: a valid ASPP packet."""
    (found,) = AsppDecoder().feed(bytes.fromhex("AA 07 00 01 75 03 00 3B 00 00 D2 00 BB"))
    assert (found.version, found.kind, found.address, found.payload) == (1, 0, 0x175, b"\x00\x3b\x00")
    assert (found.base_dbm, found.to_host) == (-46.0, True)


@pytest.mark.parametrize("version", VERSIONS)
def test_fields_of_a_packet(version: int) -> None:
    (found,) = AsppDecoder().feed(packet(version, 0x14, 50_001, b"payload", base_dbm=-71))
    assert (found.version, found.kind, found.address, found.payload) == (version, 0x14, 50_001, b"payload")
    assert (found.base_dbm, found.to_host) == (-71.0, True)


def test_an_unknown_signal_is_not_a_number() -> None:
    (found,) = AsppDecoder().feed(packet(2, 0x14, 1, b"payload", base_dbm=-205))
    assert found.base_dbm is None


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("size", [1, 2, 7, 100])
def test_packets_are_decoded_from_pieces_of_any_length(version: int, size: int) -> None:
    decoder, node = AsppDecoder(), AsppNode(version=version)
    data = node.frames(10)
    found = [one for at in range(0, len(data), size) for one in decoder.feed(data[at : at + size])]
    assert [present(read_sweeps(one)).tick for one in found] == list(range(0, 40, 4))
    assert set(decoder.faults.values()) == {0}


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_every_flipped_bit_loses_only_its_packet(version: int) -> None:
    node = AsppNode(version=version)
    good = [node.frame() for _ in range(4)]
    unprotected = range(8 * (len(good[1]) - 4), 8 * (len(good[1]) - 2)) if version == 1 else ()  # both RSSI
    for bit in range(8 * len(good[1])):
        damaged = bytearray(good[1])
        damaged[bit // 8] ^= 1 << bit % 8
        decoder = AsppDecoder()
        found = decoder.feed(good[0] + bytes(damaged) + good[2] + good[3] + good[0])
        ticks = [present(read_sweeps(one)).tick for one in found]
        assert ticks in ([0, 8, 12, 0], [0, 4, 8, 12, 0])
        assert (4 in ticks) == (bit in unprotected)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("gone", [1, 4, 20])
def test_lost_and_additional_bytes_lose_only_their_packet(version: int, gone: int) -> None:
    decoder, node = AsppDecoder(), AsppNode(version=version)
    data = node.frame() + node.frame()[:-gone] + node.frame() + NOISE[:gone] + node.frames(2)
    assert [present(read_sweeps(one)).tick for one in decoder.feed(data)] == [0, 8, 12, 16]
    assert decoder.faults["checksum"] == 2


def test_a_header_that_promises_too_much_does_not_stop_the_stream() -> None:
    decoder, node = AsppDecoder(), AsppNode()
    promise = bytes.fromhex("AB 08 1A 00 00 C3 51") + MAX_ASPP_PAYLOAD_BYTES.to_bytes(2, "big")
    ticks = [present(read_sweeps(one)).tick for _ in range(3) for one in decoder.feed(promise + node.frame())]
    assert ticks == [0, 4, 8]


def test_zeros_after_a_start_byte_within_a_packet_are_no_packet() -> None:
    """An empty packet of version 1 with zeros alone has a right sum."""
    decoder = AsppDecoder()
    data = packet(2, 0x14, 7, b"\xaa" + bytes(30))
    assert decoder.feed(data[:-1]) == []
    assert [one.address for one in decoder.feed(data[-1:])] == [7]


@pytest.mark.parametrize(("version", "kind"), LAYOUTS)
def test_sweeps_of_every_layout(version: int, kind: int) -> None:
    rows = [[0.5, -0.25, 1.0], [0.75, 0.0, -1.0]]
    (found,) = AsppDecoder().feed(packet(version, kind, 9, sweep_payload(version, kind, 65_535, rows, mask=0b1011)))
    sweeps = present(read_sweeps(found))
    assert (sweeps.tick, sweeps.rate_hz, sweeps.data_type, sweeps.channels) == (65_535, 128.0, 2, (1, 2, 4))
    assert sweeps.readings.tolist() == rows


@pytest.mark.parametrize(
    ("rate", "rate_hz"), [(113, 1), (100, 8192), (104, 512), (62, 1000), (66, 5000), (46, 300), (118, None)]
)
def test_codes_of_sample_rates(rate: int, rate_hz: float | None) -> None:
    """`WirelessTypes::WirelessSampleRate`."""
    payload = sweep_payload(2, 0x14, 0, [[0, 0, 1.0]], rate=rate)
    (found,) = AsppDecoder().feed(packet(2, 0x14, 9, payload))
    assert present(read_sweeps(found)).rate_hz == rate_hz


@pytest.mark.parametrize("low", [False, True])
def test_diagnostic_of_a_node(low: bool) -> None:
    payload = diagnostic_payload(battery_low=low, temperature_c=-3.25)
    (found,) = AsppDecoder().feed(packet(2, 0x11, 9, payload))
    assert read_diagnostic(found) == Diagnostic(30, low, -3.25)
    assert read_sweeps(found) is None


PIECES = st.lists(
    st.one_of(
        st.binary(max_size=80),
        st.tuples(st.sampled_from(VERSIONS), st.integers(0, 255), st.integers(0, 65535), st.binary(max_size=40)).map(
            lambda fields: packet(*fields)
        ),
        st.integers(0, 65535).map(lambda tick: AsppNode(tick=tick).frame()),
        st.integers(0, 60).map(lambda count: AsppNode().frame()[:count]),
        st.just(b"\xaa" * 40),
        st.just(b"\xab\x00\x00\x00"),
    ),
    max_size=30,
)


@pytest.mark.slow
@settings(max_examples=200)
@given(PIECES)
def test_any_bytes_are_decoded_or_counted_and_none_are_kept(pieces: list[bytes]) -> None:
    decoder = AsppDecoder()
    found = list(chain.from_iterable(decoder.feed(piece) for piece in pieces))
    for one in found:
        read_sweeps(one)
        read_diagnostic(one)
    sent = sum(len(piece) for piece in pieces)
    assert sum(one.length for one in found) + decoder.faults["discarded_bytes"] + decoder.buffered == sent
    assert decoder.buffered <= MAX_ASPP_PAYLOAD_BYTES + 15
    # The head of a packet in the noise may claim the longest payload of what follows.
    frames = AsppNode().frames(2 + MAX_ASPP_PAYLOAD_BYTES // len(AsppNode().frame()))
    assert [one.address for one in decoder.feed(frames)][-1:] == [50_001]
