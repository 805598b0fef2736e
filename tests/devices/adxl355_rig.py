"""An ADXL355 at the bus with its driver, and what its tests share."""

import numpy as np

from devices.adxl355 import Adxl355

RANGE, POWER_CTL, FIFO_DATA, STATUS, LEVEL = 0x2C, 0x2D, 0x11, 0x04, 0x05


class Rig:
    """A chip, a clock, and the driver on both."""

    def __init__(self, chips, *, oversleep_s=0.0001, odr_hz=125.0, range_g=2, block_samples=8, serial=None, **chip):
        self.start_ns = chips.START_NS
        self.clock = chips.FakeClock(oversleep_s)
        self.chip = chips.Adxl355Chip(self.clock, **chip)
        self.opened_bus = None
        self.device = Adxl355(
            1,
            0x1D,
            clock=self.clock,
            odr_hz=odr_hz,
            range_g=range_g,
            block_samples=block_samples,
            serial=serial,
            open_bus=self.open_bus,
        )
        self.blocks = []

    def open_bus(self, number):
        self.opened_bus = number
        self.chip.closed = False
        return self.chip

    def open(self):
        return self.device.open()

    def read_s(self, seconds):
        """Read for a while; the number of blocks."""
        until_s, before = self.clock.elapsed_s + seconds, len(self.blocks)
        while self.clock.elapsed_s < until_s:
            block = self.device.read()
            if block is not None:
                self.blocks.append(block)
        return len(self.blocks) - before

    @property
    def samples(self):
        return sum(len(block) for block in self.blocks)

    @property
    def lost(self):
        return sum(block.lost for block in self.blocks)

    @property
    def time_ns(self):
        return np.concatenate([block.time_ns for block in self.blocks])

    def made_at_s(self):
        """When each sample that came was made: it says so itself, see `telling_time`."""
        counts = np.concatenate([block.raw for block in self.blocks])
        return np.rint(counts[:, 0] / 256) + counts[:, 1] / 256000

    def error_ms(self):
        return (self.time_ns - self.start_ns) / 1e6 - self.made_at_s() * 1e3


def telling_time(time_s):
    """A signal that says when it was sampled: whole seconds on x, the rest on y (to 4 us)."""
    return int(time_s) / 1000, time_s % 1.0, -1.0
