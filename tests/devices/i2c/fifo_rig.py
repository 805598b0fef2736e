"""What every rig of an accelerometer with a FIFO does: open it, read for a while, and sum up what came."""

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from tests.devices.i2c.i2c_chip import FakeClock


class FifoRig:
    """A driver on the clock of a test, with the blocks that were read from it; a rig sets both."""

    device: FifoAccelerometer
    clock: FakeClock
    blocks: list[SampleBlock]

    def open(self) -> DeviceInfo:
        return self.device.open()

    def read_s(self, seconds: float) -> int:
        """Read for a while; the number of blocks."""
        until_s, before = self.clock.elapsed_s + seconds, len(self.blocks)
        while self.clock.elapsed_s < until_s:
            block = self.device.read()
            if block is not None:
                self.blocks.append(block)
        return len(self.blocks) - before

    @property
    def samples(self) -> int:
        return sum(len(block) for block in self.blocks)

    @property
    def lost(self) -> int:
        return sum(block.lost for block in self.blocks)

    @property
    def time_ns(self) -> NDArray[np.int64]:
        return np.concatenate([block.time_ns for block in self.blocks])
