"""Payloads of MicroStrain's wireless packets: sweeps of a node's channels, and what it reports about itself; big-endian.

Source: MicroStrain MSCL, the classes of packets that each layout names.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.serial.aspp_frames import AsppPacket

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
