"""An ADXL355 at the bus with its driver, and what its tests share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import SampleBlock
from devices.i2c.chips import CHIPS
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from tests.devices.i2c.adxl355_chip import Adxl355Chip
from tests.devices.i2c.fifo_rig import FifoRig
from tests.devices.i2c.i2c_chip import START_NS, FakeClock

RANGE, POWER_CTL, FIFO_DATA, STATUS, LEVEL = 0x2C, 0x2D, 0x11, 0x04, 0x05


class Rig(FifoRig):
    """A chip, a clock, and the driver on both."""

    def __init__(
        self,
        *,
        oversleep_s: float = 0.0001,
        odr_hz: float = 125.0,
        range_g: int = 2,
        block_samples: int = 8,
        serial: str | None = None,
        **chip: Any,
    ) -> None:
        self.start_ns = START_NS
        self.clock = FakeClock(oversleep_s)
        self.chip = Adxl355Chip(self.clock, **chip)
        self.opened_bus: int | None = None
        self.device = FifoAccelerometer(
            CHIPS["adxl355"](odr_hz, range_g),
            1,
            0x1D,
            clock=self.clock,
            block_samples=block_samples,
            serial=serial,
            open_bus=self.open_bus,
        )
        self.blocks: list[SampleBlock] = []

    def open_bus(self, number: int) -> Adxl355Chip:
        self.opened_bus = number
        self.chip.closed = False
        return self.chip

    def made_at_s(self) -> NDArray[np.float64]:
        """When each sample that came was made: it says so itself, see `telling_time`."""
        counts = np.concatenate([block.raw for block in self.blocks])
        made_s: NDArray[np.float64] = np.rint(counts[:, 0] / 256) + counts[:, 1] / 256000
        return made_s

    def error_ms(self) -> NDArray[np.float64]:
        return (self.time_ns - self.start_ns) / 1e6 - self.made_at_s() * 1e3


def telling_time(time_s: float) -> tuple[float, float, float]:
    """A signal that says when it was sampled: whole seconds on x, the rest on y (to 4 us)."""
    return int(time_s) / 1000, time_s % 1.0, -1.0
