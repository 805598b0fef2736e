"""What a MicroStrain base station passes on, written from the protocol (MicroStrain MSCL, `WirelessParser` and the packets)."""

import struct
import zlib

import numpy as np

VERSION_OF_START = {1: 0xAA, 2: 0xAB, 3: 0xAC}


def packet(version: int, kind: int, address: int, payload: bytes, base_dbm: int = -60) -> bytes:
    """Return a packet for the host."""
    start = VERSION_OF_START[version]
    if version == 1:
        body = struct.pack(">BBHB", 0x07, kind, address, len(payload)) + payload
        rssi = struct.pack(">bb", -50, base_dbm)
        return bytes([start]) + body + rssi + struct.pack(">H", sum(body) % 65536)
    body = struct.pack(">BBBIH", start, 0x08, kind, address, len(payload)) + payload
    body += bytes([155, base_dbm + 205])
    if version == 3:
        return body + struct.pack(">I", zlib.crc32(body))
    first = second = 0
    for byte in body:
        first = (first + byte) % 256
        second = (second + first) % 256
    return body + bytes([first, second])


def sweep_payload(
    version: int,
    kind: int,
    tick: int,
    rows: list[list[float]],
    *,
    mask: int = 0b111,
    rate: int = 106,
    data_type: int = 2,
) -> bytes:
    """Return the payload of a packet of sweeps; rate 106 is 128 Hz, data type 2 is float32."""
    data = np.array(rows, ">f4").tobytes()
    if version == 3:
        head = struct.pack(">IHBBH", 63_083_001, mask, rate, data_type, tick)
        return head + (struct.pack(">Q", 1_700_000_000_000_000_000) if kind == 0x1A else b"") + data
    time = struct.pack(">II", 1_700_000_000, 500) if kind in (0x0A, 0x1A) else b""
    if kind in (0x04, 0x0A, 0x0D):
        return struct.pack(">BBBBH", 2, mask, rate, data_type, tick) + time + data
    return struct.pack(">HBBH", mask, rate, 0x20 | data_type, tick) + time + data


def diagnostic_payload(*, battery_low: bool, temperature_c: float, interval_s: int = 30) -> bytes:
    """Return what a node reports about itself, with an item that is not known."""
    items = [b"\x03" + bytes([battery_low]), b"\x02\x00\x07", b"\x0b" + struct.pack(">h", round(temperature_c * 100))]
    return struct.pack(">HH", interval_s, 1) + b"".join(bytes([len(item)]) + item for item in items)


class AsppNode:
    """A node that sends buffered sweeps. Each carries its own number on x, in thousandths of g."""

    def __init__(
        self,
        *,
        version: int = 2,
        kind: int = 0x1A,
        address: int = 50_001,
        per_packet: int = 4,
        tick: int = 0,
        rate: int = 106,
    ) -> None:
        self.version, self.kind, self.address, self.per_packet, self.rate = version, kind, address, per_packet, rate
        self.number = 0
        self.first_tick = tick

    def frame(self) -> bytes:
        """Return the next packet."""
        numbers = range(self.number, self.number + self.per_packet)
        rows = [[number / 1000, -number / 1000, 1.0] for number in numbers]
        tick = (self.first_tick + self.number) % 65536
        self.number += self.per_packet
        payload = sweep_payload(self.version, self.kind, tick, rows, rate=self.rate)
        return packet(self.version, self.kind, self.address, payload)

    def frames(self, count: int) -> bytes:
        return b"".join(self.frame() for _ in range(count))

    def lose(self, packets: int) -> None:
        """Send packets that nobody receives."""
        self.number += packets * self.per_packet


def numbers_of(raw_g: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[int]:
    numbers: list[int] = np.rint(raw_g[:, 0] * 1000).astype(int).tolist()
    return numbers
