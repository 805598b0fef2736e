"""The sensor's side of a serial port, and a clock that the test sets."""

import os
import pty
import tty
from pathlib import Path

from devices.block import SampleBlock
from devices.serial_sensor import SerialSensor


class SetClock:
    """Gateway time that the test sets."""

    def __init__(self) -> None:
        self.time_ns = 1_700_000_000_000_000_000

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_s(self, seconds: float) -> None:
        self.time_ns += round(seconds * 1e9)


class Peer:
    """The sensor's side of a pseudo-terminal, and a name of the other side that outlives it."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self.master = -1
        self.plug_in()

    def plug_in(self) -> None:
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.number = os.ttyname(slave)
        os.close(slave)
        self.name.symlink_to(self.number)

    def unplug(self) -> None:
        self.close()
        self.name.unlink()

    def close(self) -> None:
        """Close the sensor's side, if that is not done."""
        if self.master >= 0:
            os.close(self.master)
            self.master = -1

    def send(self, data: bytes) -> None:
        os.write(self.master, data)

    def received(self, count: int) -> bytes:
        """Return what the gateway has sent."""
        return os.read(self.master, count)


def exchange(device: SerialSensor, peer: Peer, clock: SetClock, data: bytes, passed_s: float = 0.05) -> SampleBlock:
    """The block that comes of the data, sent in the time that has passed since the last."""
    clock.sleep_s(passed_s)
    peer.send(data)
    for _ in range(10):
        if (block := device.read()) is not None:
            return block
    raise AssertionError("no block came")
