"""Frames of MicroStrain's wireless protocol (ASPP), its packets, as a base station passes them on, versions 1 to 3; big-endian.

    v1   AA flags type address16 length8  payload nodeRSSI baseRSSI sum16        the sum leaves out AA and both RSSI
    v2   AB flags type address32 length16 payload nodeRSSI baseRSSI Fletcher-16  with sums modulo 256
    v3   AC flags type address32 length16 payload nodeRSSI baseRSSI CRC-32

A payload has sweeps of a node's channels, or what the node reports about itself. Source: MicroStrain MSCL, `WirelessParser`,
`ByteStream`, and the classes of packets that each layout names.
"""

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_ASPP_PAYLOAD_BYTES = 1024
"""A longer one is noise. Basis: a choice; nodes send less, and a header that is waited for in vain must not stop the stream."""
RSSI_ZERO_DBM = 205
"""Signal of versions 2 and 3: -205 dBm is 0, which stands for an unknown value. Definition: of the protocol."""
TO_HOST = 0x08
"""Delivery flag of a packet for the host; inverted in version 1."""


@dataclass(frozen=True, slots=True)
class AsppPacket:
    """One packet with a right checksum."""

    version: int
    kind: int
    """Type of the payload."""
    address: int
    to_host: bool
    payload: bytes
    base_dbm: float | None
    """Received power at the base."""
    length: int
    """Length of the whole packet, in bytes."""


@dataclass(frozen=True, slots=True)
class _Version:
    number: int
    header: struct.Struct
    """Start, flags, type, address, length of the payload."""
    checksum: struct.Struct
    compute: Callable[[bytes], int]
    """The checksum of all bytes before the checksum."""


def _sum16(data: bytes) -> int:
    return sum(data[1:-2]) & 0xFFFF


def fletcher16(data: bytes) -> int:
    """Return the checksum of version 2: both sums modulo 256, the first one in the high byte."""
    first = second = 0
    for byte in data:
        first += byte
        second += first
    return (first & 0xFF) << 8 | second & 0xFF


VERSIONS = {
    0xAA: _Version(1, struct.Struct(">BBBHB"), struct.Struct(">H"), _sum16),
    0xAB: _Version(2, struct.Struct(">BBBIH"), struct.Struct(">H"), fletcher16),
    0xAC: _Version(3, struct.Struct(">BBBIH"), struct.Struct(">I"), zlib.crc32),
}
"""Definition: of the protocol."""
STARTS = re.compile(rb"[\xaa\xab\xac]")
RSSI_BYTES = 2
MIN_EMBEDDED_BYTES = 6
"""Fewest bytes of a packet that is looked for inside another one. Basis: a choice; zeros after an AA look like an empty packet of
version 1, and shorter packets carry no samples."""
MIN_PACKET_BYTES = 10
"""Definition: version 1 without a payload, 10 bytes."""


class Incomplete(Exception):  # noqa: N818  (no error: more bytes are needed)
    """The bytes may be the beginning of a packet."""


def read_packet(data: bytes, at: int) -> AsppPacket | None:
    """Return the packet that begins at a position; None for none. Raises `Incomplete`."""
    version = VERSIONS.get(data[at])
    if version is None:
        return None
    if len(data) - at < version.header.size:
        raise Incomplete
    _, flags, kind, address, payload_bytes = version.header.unpack_from(data, at)
    if payload_bytes > MAX_ASPP_PAYLOAD_BYTES:
        return None
    payload_at = at + version.header.size
    checksum_at = payload_at + payload_bytes + RSSI_BYTES
    end = checksum_at + version.checksum.size
    if len(data) < end:
        raise Incomplete
    (checksum,) = version.checksum.unpack_from(data, checksum_at)
    if checksum != version.compute(data[at:checksum_at]):
        return None
    return AsppPacket(
        version=version.number,
        kind=kind,
        address=address,
        to_host=bool(flags & TO_HOST) != (version.number == 1),
        payload=data[payload_at : payload_at + payload_bytes],
        base_dbm=_dbm(data[checksum_at - 1], version.number),
        length=end - at,
    )


def _dbm(value: int, version: int) -> float | None:
    if version == 1:
        return float(value - 256 if value > 127 else value)
    return float(value - RSSI_ZERO_DBM) if value else None


class AsppDecoder:
    """Finds the packets in a stream of bytes; stores less than one packet."""

    def __init__(self) -> None:
        self.faults = {"checksum": 0, "discarded_bytes": 0}
        self.reset()

    def reset(self) -> None:
        """Discard the stream after the port was opened again; the counts remain."""
        self._buffer = b""
        self._in_step = False  # the buffer begins where a packet has ended
        self.bytes_since_packet = 0

    @property
    def buffered(self) -> int:
        """Number of bytes of a packet that is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[AsppPacket]:
        """Decode bytes; never raises, whatever they are."""
        self._buffer += data
        packets = []
        while (found := self._find_packet()) is not None:
            at, packet = found
            self._discard(at)
            self._buffer = self._buffer[packet.length :]
            self._in_step = True
            self.bytes_since_packet = 0
            packets.append(packet)
        return packets

    def _find_packet(self) -> tuple[int, AsppPacket] | None:
        """Return the next packet and its position. A packet within an incomplete one shows that the latter was cut."""
        waiting: int | None = None
        for start in STARTS.finditer(self._buffer):
            at = start.start()
            try:
                packet = read_packet(self._buffer, at)
            except Incomplete:
                waiting = at if waiting is None else waiting
                continue
            if packet is not None and (waiting is None or len(packet.payload) >= MIN_EMBEDDED_BYTES):
                return at, packet
        self._discard(len(self._buffer) if waiting is None else waiting)
        return None

    def _discard(self, count: int) -> None:
        if count:
            self.faults["checksum"] += self._in_step
            self.faults["discarded_bytes"] += count
            self.bytes_since_packet += count
            self._in_step = False
            self._buffer = self._buffer[count:]


CALIBRATED = 2
"""Data type float32 in the unit that is set in the node; all others are uncalibrated or too coarse."""
MAX_TYPE = 15
"""Definition: four bits."""
SAMPLE_RATES_HZ = {113 - power: float(1 << power) for power in range(14)} | {
    46: 300.0,
    47: 800.0,
    48: 1600.0,
    49: 3200.0,
    98: 887.0,
}
"""`WirelessTypes::WirelessSampleRate`: 113 is 1 Hz, 100 is 8192 Hz. Definition: codes of the protocol."""
SAMPLE_RATES_HZ |= {61 + kilohertz: 1000.0 * kilohertz for kilohertz in range(1, 11)}
DIAGNOSTIC = 0x11


@dataclass(frozen=True, slots=True)
class _Layout:
    """Positions of the fields in a payload of sweeps."""

    mask: int
    mask_bytes: int
    data: int

    @property
    def rate(self) -> int:
        return self.mask + self.mask_bytes

    @property
    def data_type(self) -> int:
        return self.rate + 1

    @property
    def tick(self) -> int:
        return self.rate + 2


LAYOUTS = {
    (1, 0x04): _Layout(1, 1, 6),  # LdcPacket
    (1, 0x0D): _Layout(1, 1, 6),  # BufferedLdcPacket
    (1, 0x0A): _Layout(1, 1, 14),  # SyncSamplingPacket
    (2, 0x14): _Layout(0, 2, 6),  # LdcPacket_v2
    (2, 0x1D): _Layout(0, 2, 6),  # BufferedLdcPacket_v2
    (2, 0x1A): _Layout(0, 2, 14),  # SyncSamplingPacket_v2
    (3, 0x14): _Layout(4, 2, 10),  # LdcPacket_v2_aspp3
    (3, 0x1A): _Layout(4, 2, 18),  # SyncSamplingPacket_v2_aspp3
}
"""By version and type. Types 0x04 to 0x0D also come in version 2, and 0x14 to 0x1D in version 1. Definition: of the protocol."""
LAYOUTS |= {(2, kind): layout for (version, kind), layout in LAYOUTS.items() if version == 1} | {
    (1, kind): layout for (version, kind), layout in LAYOUTS.items() if version == 2
}
LOW_NIBBLE_TYPES = (0x14, 0x1D, 0x1A)
"""Of versions 1 and 2: the data type is the low half of its byte."""


@dataclass(frozen=True, slots=True)
class Sweeps:
    """Consecutive samples of the active channels of a node."""

    tick: int
    """Number of the first sweep, modulo 65536."""
    rate_hz: float | None
    """None: a rate below 1 Hz, or one that is not known here."""
    data_type: int
    channels: tuple[int, ...]
    """The active channels, from 1 on."""
    readings: NDArray[np.float64]
    """Shape (n, number of channels); empty unless the data are calibrated."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """What a node reports about itself; None: not reported."""

    interval_s: int
    battery_low: bool | None
    temperature_c: float | None


def read_sweeps(packet: AsppPacket) -> Sweeps | None:
    """Return the sweeps of a packet; None where it is of another type, or makes no sense."""
    layout = LAYOUTS.get((packet.version, packet.kind))
    payload = packet.payload
    if layout is None or not packet.to_host or len(payload) <= layout.data:
        return None
    mask = int.from_bytes(payload[layout.mask : layout.rate], "big")
    data_type = payload[layout.data_type]
    if packet.version < 3 and packet.kind in LOW_NIBBLE_TYPES:
        data_type &= 0x0F
    (tick,) = struct.unpack_from(">H", payload, layout.tick)
    channels = tuple(bit + 1 for bit in range(16) if mask >> bit & 1)
    if not channels or not 1 <= data_type <= MAX_TYPE:
        return None
    data = payload[layout.data :] if data_type == CALIBRATED else b""
    if len(data) % (4 * len(channels)):
        return None
    readings = np.frombuffer(data, ">f4").astype(np.float64).reshape(-1, len(channels))
    return Sweeps(tick, SAMPLE_RATES_HZ.get(payload[layout.rate]), data_type, channels, readings)


def read_diagnostic(packet: AsppPacket) -> Diagnostic | None:
    """Return the diagnostic of a packet (`DiagnosticPacket`); None where it is of another type, or makes no sense."""
    if packet.kind != DIAGNOSTIC or not packet.to_host or len(packet.payload) < 7:
        return None
    payload = packet.payload
    (interval_s,) = struct.unpack_from(">H", payload)
    items: dict[int, bytes] = {}
    at = 4
    while at < len(payload):
        length = payload[at]
        if not length or at + 1 + length > len(payload):
            return None
        items[payload[at + 1]] = payload[at + 2 : at + 1 + length]
        at += 1 + length
    return Diagnostic(interval_s, _battery_low(items), _temperature_c(items))


def _battery_low(items: dict[int, bytes]) -> bool | None:
    flag = items.get(0x03, b"")
    return bool(flag[0]) if len(flag) == 1 else None


def _temperature_c(items: dict[int, bytes]) -> float | None:
    fine, coarse = items.get(0x0B, b""), items.get(0x09, b"")
    if len(fine) == 2:
        return int.from_bytes(fine, "big", signed=True) / 100
    return float(int.from_bytes(coarse, "big", signed=True)) if len(coarse) == 1 else None
