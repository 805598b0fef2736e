"""A chip at the bus with its driver: the rows of all parts, and what the tests of all parts share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import SampleBlock
from devices.i2c.chips import CHIPS
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from tests.devices.i2c import adxl345_chip, adxl355_chip, lis2dw12_chip, lis3dh_chip, mpu9250_chip
from tests.devices.i2c.fifo_rig import FifoRig
from tests.devices.i2c.i2c_chip import START_NS, FakeClock, I2cChip, Signal
from tests.devices.i2c.part import Part

__all__ = ["PARTS", "Part", "PartRig", "numbered"]

PARTS = (
    adxl355_chip.ADXL355,
    adxl355_chip.ADXL357,
    adxl345_chip.PART,
    lis3dh_chip.PART,
    lis2dw12_chip.PART,
    mpu9250_chip.MPU9250,
    mpu9250_chip.MPU6050,
)


class PartRig(FifoRig):
    """A chip, a clock, and the driver on both."""

    def __init__(
        self,
        part: Part,
        *,
        odr_hz: float | None = None,
        range_g: int | None = None,
        oversleep_s: float = 0.0001,
        **chip: Any,
    ) -> None:
        self.part = part
        self.odr_hz = part.odr_hz if odr_hz is None else odr_hz
        self.clock = FakeClock(oversleep_s)
        self.chip = part.chip(self.clock, **chip)
        self.device = FifoAccelerometer(
            CHIPS[part.kind](self.odr_hz, part.range_g if range_g is None else range_g),
            1,
            self.chip.addresses[0],
            clock=self.clock,
            open_bus=self.open_bus,
        )
        self.identity = CHIPS[part.kind].identities[0]
        self.blocks: list[SampleBlock] = []

    def open_bus(self, number: int) -> I2cChip:
        self.chip.closed = False
        return self.chip

    @property
    def raw(self) -> NDArray[np.int32]:
        return np.concatenate([block.raw for block in self.blocks]).astype(np.int32)

    def made_ms(self) -> NDArray[np.int64]:
        """When each sample that came was made, to 1 ms since the start: it says so itself, see `numbered`."""
        digits = np.rint(self.raw / DIGIT_COUNTS).astype(np.int64)
        made_ms: NDArray[np.int64] = digits @ np.array([1, BASE, BASE**2])
        return made_ms

    def errors_ms(self) -> NDArray[np.float64]:
        """Sample times minus the true ones."""
        made = np.array(self.chip.made_ns, dtype=np.int64)
        index = np.searchsorted((made - START_NS) // 1_000_000, self.made_ms())
        return (self.time_ns - made[index]) / 1e6


BASE, DIGIT_COUNTS = 200, 2


def numbered(part: Part) -> Signal:
    """A signal that says when it was sampled, in whole milliseconds: three digits of base 200 on the three axes."""

    def signal(time_s: float) -> tuple[float, float, float]:
        time_ms = int(time_s * 1000)
        digits = (time_ms % BASE, time_ms // BASE % BASE, time_ms // BASE**2)
        x, y, z = (DIGIT_COUNTS * digit / part.units_per_g for digit in digits)
        return x, y, z

    return signal
