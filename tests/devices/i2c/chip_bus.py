"""Several chips on the wires of one I2C bus."""

import errno
from typing import Any

from tests.devices.i2c.i2c_chip import FakeClock, I2cChip


class ChipBus:
    """At the place of `smbus2.SMBus`; only bus 1 exists."""

    def __init__(self, clock: FakeClock, *chips: I2cChip) -> None:
        self.clock = clock
        self.chips = {chip.address: chip for chip in chips}

    def __call__(self, number: int) -> "ChipBus":
        if number != 1:
            raise FileNotFoundError(errno.ENOENT, "no such bus")
        for chip in self.chips.values():
            chip.closed = False
        return self

    def i2c_rdwr(self, *messages: Any) -> None:
        chip = self.chips.get(messages[0].addr)
        if chip is None:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")
        chip.i2c_rdwr(*messages)

    def close(self) -> None:
        pass
