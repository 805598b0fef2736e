"""Framing of MicroStrain's wireless protocol (ASPP) as a base station passes it on, versions 1 to 3; big-endian.

    v1   AA flags type address16 length8  payload nodeRSSI baseRSSI sum16        the sum leaves out AA and both RSSI
    v2   AB flags type address32 length16 payload nodeRSSI baseRSSI Fletcher-16  with sums modulo 256
    v3   AC flags type address32 length16 payload nodeRSSI baseRSSI CRC-32

Source: MicroStrain MSCL, `WirelessParser`, `ByteStream`.
"""

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

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
