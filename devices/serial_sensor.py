"""A sensor or radio base on a serial port: what all of them share. What the bytes mean is a `SerialPart`."""

from collections import deque
from collections.abc import Mapping
from typing import Protocol

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import MAX_READ_S
from devices.errors import DeviceError, TransferError
from devices.serial_port import SerialPort

RATE_WINDOW_S = 10.0
"""Basis: a choice; the rate is known to a per cent at 10 Hz, and a change is told soon."""
MAX_RATE_DIFFERENCE = 0.15
"""Relative difference from the rate as stated. Basis: larger than the deviation of a sensor's clock, smaller than the distance to
the next rate that can be set."""
FRAMELESS_LIMIT_BYTES = 2048
"""This many bytes without a frame are more than a disturbance. Basis: a choice; a disturbance spoils some frames, a wrong baud
rate all."""
FIRST_PATIENCE_NS, LATER_PATIENCE_NS = 2_500_000_000, 10_000_000_000
"""Before the wanted node was heard for the first time, which more often has a cause in the configuration, and later. Basis: a
choice; nodes at usual rates send several times per second, and a radio link returns within seconds."""
MAX_PATIENCE_NS = 600_000_000_000
"""A node may sleep for days beside others: each report doubles the time to the next one. Basis: a choice; ten minutes, a few
lines an hour."""
MAX_NODES = 32
"""Basis: a choice; more than a base station serves at one crane, and a bound of the memory."""


class RateCheck:
    """Counts samples: with a wrong `odr_hz` sample times would be plausible but wrong."""

    def __init__(self, odr_hz: float) -> None:
        self._odr_hz = odr_hz
        self._start_ns: int | None = None
        self._count = 0

    def restart(self) -> None:
        """Begin again after an interruption."""
        self._start_ns = None

    def add(self, count: int, read_ns: int) -> None:
        """Count samples, lost ones included, that were read at this gateway time. Raises `DeviceError` for a wrong rate."""
        if self._start_ns is None:
            self._start_ns, self._count = read_ns, 0
            return
        self._count += count
        elapsed_s = (read_ns - self._start_ns) / 1e9
        if elapsed_s < RATE_WINDOW_S:
            return
        rate_hz = self._count / elapsed_s
        self._start_ns, self._count = read_ns, 0
        if abs(rate_hz / self._odr_hz - 1) > MAX_RATE_DIFFERENCE:
            came = f"{rate_hz:.1f} samples/s arrive, but odr_hz is {self._odr_hz:g}"
            raise DeviceError(f"{came}; set odr_hz to the sensor's rate, or bring the radio nearer")


class SerialPart(Protocol):
    """The protocol of one kind of sensor: bytes in, blocks out. It neither waits nor raises for bad bytes."""

    def info(self, port: SerialPort) -> DeviceInfo:
        """Return the properties of the sensor on an open port."""
        ...

    def reset(self) -> None:
        """Discard what was received, after the port was opened; counts of faults remain."""
        ...

    def feed(self, data: bytes, read_ns: int) -> list[SampleBlock]:
        """Return the blocks that bytes complete, which were read at this gateway time; no bytes: half a second of silence.

        Raises `DeviceError` where the sensor and the configuration do not agree.
        """
        ...

    def bytes_until(self, samples: int) -> int:
        """Return the number of bytes that are missing until the newest of so many samples is complete."""
        ...

    def request(self, now_ns: int) -> bytes:
        """Return what is to be sent to the sensor now; usually nothing."""
        ...

    @property
    def bytes_since_frame(self) -> int:
        """Number of bytes since the newest frame, or since the start."""
        ...

    @property
    def frame(self) -> str:
        """The name of the frame that is missing where none comes, such as `acceleration frame`."""
        ...

    @property
    def advice(self) -> str:
        """What else to check where no frame comes."""
        ...

    @property
    def faults(self) -> Mapping[str, int]:
        """Number of faults by name."""
        ...


class SerialSensor:
    """A device on a serial port, which is found again after it was unplugged."""

    def __init__(
        self, part: SerialPart, port: SerialPort, *, clock: Clock, odr_hz: float, block_samples: int = 8
    ) -> None:
        """`odr_hz`: the rate set in the sensor; `block_samples`: usual length of a block."""
        self._part = part
        self._port = port
        self._clock = clock
        self._block_samples = block_samples
        self._rate_check = RateCheck(odr_hz)
        self._blocks: deque[SampleBlock] = deque()
        self._disconnects = 0

    def open(self) -> DeviceInfo:
        """Open the port, without waiting for a frame: a radio may still be asleep."""
        self._port.open(MAX_READ_S)
        self._part.reset()
        self._blocks.clear()
        self._rate_check.restart()
        return self._part.info(self._port)

    def read(self) -> SampleBlock | None:
        """Return the next block.

        Raises `TransferError` when the port has gone, `DeviceError` when the bytes contain no frames, or frames at another rate
        than `odr_hz`.
        """
        if not self._blocks:
            self._receive()
        return self._blocks.popleft() if self._blocks else None

    def close(self) -> None:
        """Release the port."""
        self._port.close()

    @property
    def faults(self) -> Mapping[str, int]:
        """The faults of the sensor, and disconnections."""
        return {**self._part.faults, "disconnect": self._disconnects}

    def _receive(self) -> None:
        data = self._transfer()
        read_ns = self._clock.now_ns()
        try:
            blocks = self._part.feed(data, read_ns)
            if not data:
                self._rate_check.restart()
            elif blocks:
                self._rate_check.add(sum(len(block) + block.lost + block.invalid for block in blocks), read_ns)
        except DeviceError as error:
            raise DeviceError(f"{self._port}: {error}") from error
        self._blocks.extend(blocks)
        since = self._part.bytes_since_frame
        if since >= FRAMELESS_LIMIT_BYTES:
            none = f"{self._port}: no {self._part.frame} in {since} bytes at {self._port.baud} baud"
            raise DeviceError(f"{none}; check the baud rate, and {self._part.advice}")

    def _transfer(self) -> bytes:
        try:
            request = self._part.request(self._clock.now_ns())
            if request:
                self._port.write(request)
            return self._port.read(self._part.bytes_until(self._block_samples))
        except TransferError:
            self._disconnects += 1
            raise


def check_settings(odr_hz: float, block_samples: int) -> None:
    """Raise `ValueError` for a rate or length of blocks that is impossible."""
    if not odr_hz > 0 or block_samples < 1:
        raise ValueError(
            f"{block_samples} samples per block at {odr_hz:g} Hz are impossible; give at least 1 and a rate above 0"
        )


class HeardNodes:
    """Counts the frames of all nodes."""

    def __init__(self, wanted: int) -> None:
        self._wanted = wanted
        self._others: dict[int, int] = {}
        self._since_ns: int | None = None
        self._patience_ns = FIRST_PATIENCE_NS

    def restart(self) -> None:
        """Begin again, after the port was opened."""
        self._others.clear()
        self._since_ns = None

    def add(self, node: int, read_ns: int) -> bool:
        """Count a frame; return whether it is one of the wanted node."""
        if self._since_ns is None:
            self._since_ns = read_ns
        if node == self._wanted:
            self._since_ns = read_ns
            self._patience_ns = LATER_PATIENCE_NS
            return True
        if node in self._others or len(self._others) < MAX_NODES:
            self._others[node] = self._others.get(node, 0) + 1
        return False

    def check(self, read_ns: int) -> None:
        """Raise `DeviceError` when only frames of other nodes have come for some seconds."""
        if self._others and self._since_ns is not None and read_ns - self._since_ns > self._patience_ns:
            self._patience_ns = min(2 * self._patience_ns, MAX_PATIENCE_NS)
            heard = ", ".join(f"{node} ({count} frames)" for node, count in sorted(self._others.items()))
            raise DeviceError(f"node {self._wanted} is not heard; heard are {heard}; set device.node, or wake the node")
