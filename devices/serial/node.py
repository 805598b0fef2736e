"""A radio node of one's own behind a receiver on a serial port; its frames are described in docs/guides/integrator/node.md."""

from collections.abc import Mapping

import numpy as np

from devices.block import DeviceInfo, RadioStatus, SampleBlock
from devices.clock import Clock
from devices.node_numbering import Placement, SampleSequence, TickClock
from devices.sample_loss import lost_in_pause
from devices.saturation import mark_saturated
from devices.serial.node_frames import (
    HEADER,
    MAX_ENCODED_BYTES,
    MAX_FRAME_SAMPLES,
    MIN_FRAME_BYTES,
    NodeFrame,
    NodeFrameDecoder,
)
from devices.serial_port import SerialPort
from devices.serial_sensor import HeardNodes, SerialSensor, check_settings

G_PER_SCALE = 1e-9
"""Definition: the scale is in ng (docs/guides/integrator/node.md)."""


def open_node(
    port: str,
    baud: int = 115200,
    *,
    node: int,
    clock: Clock,
    odr_hz: float = 100.0,
    range_g: float | None = None,
    block_samples: int = 8,
    serial: str | None = None,
) -> SerialSensor:
    """Return the node on a port, not yet opened; see `NodePart` and `SerialPort`. Raises `ValueError`."""
    check_settings(odr_hz, block_samples)
    part = NodePart(node=node, odr_hz=odr_hz, range_g=range_g, serial=serial)
    return SerialSensor(part, SerialPort(port, baud), clock=clock, odr_hz=odr_hz, block_samples=block_samples)


class NodePart:
    """The frames of one node; a receiver may pass on those of several.

    Lost samples are counted by the sequence number; sample times follow the node's own clock, see `devices.node_numbering`.
    """

    frame = "valid frame"
    advice = "that the receiver passes on frames of version 1"

    def __init__(self, *, node: int, odr_hz: float, range_g: float | None = None, serial: str | None = None) -> None:
        """`node`: number of the node; `range_g`: its full scale, where known; `serial`: a label instead of the number."""
        self._node = node
        self._odr_hz = odr_hz
        self._range_g = range_g
        self._serial = serial
        self._decoder = NodeFrameDecoder()
        self._heard = HeardNodes(node)
        self._sequence = SampleSequence(32, odr_hz)
        self._tick_clock = TickClock(odr_hz)
        self._boot: int | None = None
        self._last_ns: int | None = None
        self._frame_bytes, self._frame_samples = MIN_FRAME_BYTES, MAX_FRAME_SAMPLES  # not known yet
        self._faults = {"repeated_frames": 0, "node_restarted": 0}

    def info(self, port: SerialPort) -> DeviceInfo:
        """Return the properties of the node behind an open port."""
        return DeviceInfo(
            kind="node",
            device_id=f"node-{self._serial or self._node}",
            unit="g",
            odr_hz=self._odr_hz,
            units_per_g=1.0,
            full_scale_g=self._range_g,
            details={"port": str(port), "baud": str(port.baud), "node": str(self._node), "checksum": "CRC-16"},
        )

    def reset(self) -> None:
        """Discard what was received, after the port was opened; counts of faults, numbers and times continue."""
        self._decoder.reset()
        self._heard.restart()

    def bytes_until(self, samples: int) -> int:
        """Return the number of bytes that are missing until the newest of so many samples is complete."""
        return self._decoder.bytes_until(-(-samples // self._frame_samples), self._frame_bytes)

    def request(self, now_ns: int) -> bytes:
        """Return nothing: a node is not asked."""
        return b""

    @property
    def bytes_since_frame(self) -> int:
        """Number of bytes since the newest valid frame of any node, or since the start of the stream."""
        return self._decoder.bytes_since_frame

    @property
    def faults(self) -> Mapping[str, int]:
        """Damaged and repeated frames, starts of the node, restarts of the clock."""
        return {**self._decoder.faults, **self._faults, "clock_relearned": self._tick_clock.relearned}

    def feed(self, data: bytes, read_ns: int) -> list[SampleBlock]:
        """Return the blocks that bytes complete. Raises `DeviceError` where only other nodes are heard."""
        blocks = []
        for frame in self._decoder.feed(data):
            if self._heard.add(frame.node, read_ns):
                block = self._block(frame, read_ns)
                if block is not None:
                    blocks.append(block)
        self._heard.check(read_ns)
        return blocks

    def _block(self, frame: NodeFrame, read_ns: int) -> SampleBlock | None:
        placement = self._place(frame, read_ns)
        n = len(frame.counts) - placement.repeated
        if not n:
            self._faults["repeated_frames"] += 1
            return None
        time_ns = self._tick_clock.stamp(n, frame.t_us, read_ns, placement.lost)
        if placement.restarted and self._last_ns is not None:
            time_ns = np.maximum(time_ns, self._last_ns + 1 + np.arange(n))
            lost = lost_in_pause(self._last_ns, int(time_ns[0]), self._odr_hz)
        else:
            lost = placement.lost
        self._last_ns = int(time_ns[-1])
        counts = frame.counts[placement.repeated :].astype(np.int32)
        self._frame_samples = len(frame.counts)
        self._frame_bytes = min(HEADER.size + 6 * self._frame_samples + 4, MAX_ENCODED_BYTES)
        return SampleBlock(
            time_ns=time_ns,
            raw=counts.astype(np.float64) * (frame.scale_ng * G_PER_SCALE),
            temperature_c=frame.temperature_c,
            lost=lost,
            radio=RadioStatus(battery_v=frame.battery_v, battery_low=frame.battery_low, signal_dbm=frame.signal_dbm),
            saturated=mark_saturated(counts, -frame.full_scale, frame.full_scale),
        )

    def _place(self, frame: NodeFrame, read_ns: int) -> Placement:
        """Return the place of a frame among the samples; begin anew where the node has, or where its clock does not continue."""
        if frame.boot != self._boot:
            self._sequence.restart()
        placement = self._sequence.place(frame.sequence, len(frame.counts), read_ns)
        new = len(frame.counts) - placement.repeated
        if not new:
            return placement
        if placement.restarted or not self._tick_clock.continues(frame.t_us, new + placement.lost):
            self._faults["node_restarted"] += self._boot is not None
            self._tick_clock.restart()
            placement = Placement(lost=0, repeated=placement.repeated, restarted=True)
        self._boot = frame.boot
        return placement
