"""A chip at the bus with its driver: one row for each part, and what the tests of all parts share."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import SampleBlock
from devices.i2c.chips import CHIPS
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from tests.devices.i2c.adxl345_chip import Adxl345Chip
from tests.devices.i2c.adxl355_chip import Adxl355Chip, Adxl357Chip
from tests.devices.i2c.fifo_rig import FifoRig
from tests.devices.i2c.i2c_chip import START_NS, FakeClock, I2cChip, Signal
from tests.devices.i2c.lis2dw12_chip import Lis2dw12Chip
from tests.devices.i2c.lis3dh_chip import Lis3dhChip
from tests.devices.i2c.mpu9250_chip import Mpu6050Chip, Mpu9250Chip


@dataclass(frozen=True)
class Part:
    """A kind of device at a usual rate, the model of its chip, and what its data sheet says of them."""

    kind: str
    chip: type[I2cChip]
    odr_hz: float
    range_g: int
    units_per_g: float
    configured: tuple[int, ...]
    """Registers whose loss is to be noticed: of the rate, of the range, of the start."""
    level_registers: tuple[int, ...]
    """Registers whose reading gives the level of the FIFO, the one that is addressed first."""
    other_odr_hz: float
    other_range_g: int
    """Neither the rate nor the range that the chip has after power-on."""
    resets_fifo: bool = False
    """Whether an interrupted burst costs the whole FIFO, because it may no longer begin with a sample."""

    def __str__(self) -> str:
        return self.kind


PARTS = (
    Part("adxl355", Adxl355Chip, 125.0, 2, 256000, (0x28, 0x2C, 0x2D), (0x04, 0x05), 125.0, 4),
    Part("adxl357", Adxl357Chip, 125.0, 10, 51200, (0x28, 0x2C, 0x2D), (0x04, 0x05), 125.0, 20),
    Part("adxl345", Adxl345Chip, 100.0, 2, 256, (0x2C, 0x31, 0x2D), (0x39,), 200.0, 4),
    Part("lis3dh", Lis3dhChip, 100.0, 2, 1000, (0x23, 0x24, 0x20), (0x2F,), 200.0, 4),
    Part("lis2dw12", Lis2dw12Chip, 100.0, 2, 4096, (0x25, 0x2E, 0x20), (0x2F,), 200.0, 4),
    Part("mpu9250", Mpu9250Chip, 100.0, 2, 16384, (0x19, 0x1C, 0x6A), (0x72, 0x73), 200.0, 4, resets_fifo=True),
    Part("mpu6050", Mpu6050Chip, 100.0, 2, 16384, (0x19, 0x1C, 0x6A), (0x72, 0x73), 200.0, 4, resets_fifo=True),
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
        self.identity = CHIPS[part.kind](self.odr_hz, part.range_g).identities[0]
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
