"""MicroStrain wireless nodes (ASPP) behind a base station on a serial port."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, RadioStatus, SampleBlock
from devices.clock import Clock
from devices.errors import DeviceError
from devices.node_numbering import SampleSequence
from devices.sample_clock import RADIO_MISFIT_DELAY_S, SampleClock
from devices.sample_loss import lost_in_pause
from devices.saturation import mark_saturated
from devices.serial.aspp_frames import (
    CALIBRATED,
    MIN_PACKET_BYTES,
    AsppDecoder,
    AsppPacket,
    Diagnostic,
    Sweeps,
    read_diagnostic,
    read_sweeps,
)
from devices.serial_port import SerialPort
from devices.serial_sensor import HeardNodes, SerialSensor, check_settings

TICK_BITS = 16
"""Definition: of a sweep's number."""
MAX_SWEEP_RATE_DIFFERENCE = 0.01
"""Relative difference from the rate as stated. Basis: a choice; crystals differ by 1e-4, and the next rate by a factor."""
REMEMBERED_LENGTHS = 16
"""Basis: a choice; packets of a node have one or two lengths."""
DIAGNOSTIC_INTERVALS = 2.5
"""A diagnostic is valid for so many of its intervals. Basis: one may be lost."""


def open_aspp(
    port: str,
    baud: int = 921600,
    *,
    node: int,
    clock: Clock,
    range_g: float,
    odr_hz: float = 128.0,
    channels: Sequence[int] = (1, 2, 3),
    units_per_g: float = 1.0,
    block_samples: int = 8,
    serial: str | None = None,
) -> SerialSensor:
    """Return the node behind a base, not yet opened; see `AsppPart` and `SerialPort`. Raises `ValueError`."""
    check_settings(odr_hz, block_samples)
    part = AsppPart(
        node=node, odr_hz=odr_hz, range_g=range_g, channels=channels, units_per_g=units_per_g, serial=serial
    )
    return SerialSensor(part, SerialPort(port, baud), clock=clock, odr_hz=odr_hz, block_samples=block_samples)


class AsppPart:
    """The packets of one node; a base passes on those of all.

    The node samples already, started by the maker's software. Each packet states the number of its first sweep (tick), by which
    lost ones are counted and sample times found, see `devices.sample_clock`.
    """

    frame = "valid packet"
    advice = "that the base station passes packets on"

    def __init__(
        self,
        *,
        node: int,
        odr_hz: float,
        range_g: float,
        channels: Sequence[int] = (1, 2, 3),
        units_per_g: float = 1.0,
        serial: str | None = None,
    ) -> None:
        """`node`: its address; `channels`: those of x, y and z; `units_per_g`: readings per g in the unit that is set in it.

        `range_g`: full scale as set in the node; `serial`: a label instead of the address.
        """
        self._node = node
        self._odr_hz = odr_hz
        self._range_g = range_g
        self._channels = tuple(channels)
        self._units_per_g = units_per_g
        self._serial = serial
        self._decoder = AsppDecoder()
        self._heard = HeardNodes(node)
        self._sequence = SampleSequence(TICK_BITS, odr_hz)
        self._sample_clock = SampleClock(odr_hz, misfit_delay_s=RADIO_MISFIT_DELAY_S)
        self._lengths = deque[int]([MIN_PACKET_BYTES], maxlen=REMEMBERED_LENGTHS)
        self._last_ns: int | None = None
        self._lost = self._invalid = 0  # before the next block
        self._diagnostic: tuple[int, Diagnostic] | None = None
        self._faults = {"repeated_frames": 0, "node_restarted": 0}

    def info(self, port: SerialPort) -> DeviceInfo:
        """Return the properties of the node behind an open port."""
        return DeviceInfo(
            kind="aspp",
            device_id=f"aspp-{self._serial or self._node}",
            unit="g",
            odr_hz=self._odr_hz,
            units_per_g=1.0,
            full_scale_g=self._range_g,
            details={"port": str(port), "baud": str(port.baud), "node": str(self._node)},
        )

    def reset(self) -> None:
        """Discard what was received, after the port was opened; counts of faults, numbers and times continue."""
        self._decoder.reset()
        self._heard.restart()

    def bytes_until(self, samples: int) -> int:
        """Return the number of bytes that are missing until the shortest packet is complete."""
        return max(min(self._lengths) - self._decoder.buffered, 1)

    def request(self, now_ns: int) -> bytes:
        """Return nothing: the node was started by the maker's software."""
        return b""

    @property
    def bytes_since_frame(self) -> int:
        """Number of bytes since the newest packet of any node, or since the start of the stream."""
        return self._decoder.bytes_since_packet

    @property
    def faults(self) -> Mapping[str, int]:
        """Damaged and repeated packets, starts of the node, restarts of the sample clock."""
        return {**self._decoder.faults, **self._faults, "clock_relearned": self._sample_clock.relearned}

    def feed(self, data: bytes, read_ns: int) -> list[SampleBlock]:
        """Return the blocks that bytes complete.

        Raises `DeviceError` where only other nodes are heard, or where the node's channels, rate or data format do not agree.
        """
        blocks: list[SampleBlock] = []
        for packet in self._decoder.feed(data):
            self._lengths.append(packet.length)
            if self._heard.add(packet.address, read_ns):
                blocks.extend(self._blocks(packet, read_ns))
        self._heard.check(read_ns)
        return blocks

    def _blocks(self, packet: AsppPacket, read_ns: int) -> Iterator[SampleBlock]:
        diagnostic = read_diagnostic(packet)
        if diagnostic is not None:
            self._diagnostic = read_ns, diagnostic
        sweeps = read_sweeps(packet)
        if sweeps is not None:
            self._check_settings(sweeps)
            yield from self._sweep_blocks(sweeps, packet.base_dbm, read_ns)

    def _check_settings(self, sweeps: Sweeps) -> None:
        if sweeps.data_type != CALIBRATED:
            sent = f"node {self._node} sends data type {sweeps.data_type}"
            raise DeviceError(f"{sent}, which is not calibrated; set its data format to calibrated (float)")
        missing = [channel for channel in self._channels if channel not in sweeps.channels]
        if missing:
            sent = f"node {self._node} sends channels {list(sweeps.channels)}"
            raise DeviceError(f"{sent}, but device.channels is {list(self._channels)}; activate them, or set the key")
        if sweeps.rate_hz is not None and abs(sweeps.rate_hz / self._odr_hz - 1) > MAX_SWEEP_RATE_DIFFERENCE:
            sent = f"node {self._node} is set to {sweeps.rate_hz:g} samples/s"
            raise DeviceError(f"{sent}, but odr_hz is {self._odr_hz:g}; set odr_hz to the node's rate")

    def _sweep_blocks(self, sweeps: Sweeps, base_dbm: float | None, read_ns: int) -> Iterator[SampleBlock]:
        """Return blocks with sample times; after samples that are not numbers a new block begins."""
        count = len(sweeps.readings)
        placement = self._sequence.place(sweeps.tick, count, read_ns)
        if placement.repeated == count:
            self._faults["repeated_frames"] += 1
            return
        if placement.restarted:
            self._faults["node_restarted"] += self._last_ns is not None
            self._sample_clock.restart()
        time_ns = self._sample_clock.stamp(count - placement.repeated, read_ns, lost=placement.lost)
        lost = lost_in_pause(self._last_ns, int(time_ns[0]), self._odr_hz) if placement.restarted else placement.lost
        columns = [sweeps.channels.index(channel) for channel in self._channels]
        raw_g = sweeps.readings[placement.repeated :, columns] / self._units_per_g
        usable: NDArray[np.bool_] = np.asarray(np.isfinite(raw_g).all(axis=1))
        diagnostic = self._present_diagnostic(read_ns)
        self._lost += lost
        edges = [0, *(np.flatnonzero(np.diff(usable)) + 1).tolist(), len(usable)]  # of the runs of equal values
        for first, end in pairwise(edges):
            if not usable[first]:
                self._invalid += end - first
                continue
            yield SampleBlock(
                time_ns=time_ns[first:end],
                raw=raw_g[first:end],
                temperature_c=None if diagnostic is None else diagnostic.temperature_c,
                lost=self._lost,
                invalid=self._invalid,
                radio=RadioStatus(
                    battery_low=None if diagnostic is None else diagnostic.battery_low, signal_dbm=base_dbm
                ),
                saturated=mark_saturated(raw_g[first:end], -self._range_g, self._range_g),
            )
            self._lost = self._invalid = 0
            self._last_ns = int(time_ns[end - 1])

    def _present_diagnostic(self, read_ns: int) -> Diagnostic | None:
        if self._diagnostic is None:
            return None
        received_ns, diagnostic = self._diagnostic
        stale = read_ns - received_ns > DIAGNOSTIC_INTERVALS * diagnostic.interval_s * 1e9
        return None if stale else diagnostic
