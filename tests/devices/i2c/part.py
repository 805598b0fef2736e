"""What the tests of all parts know of one: its row, which the model of its chip declares."""

from dataclasses import dataclass
from typing import Literal

from tests.devices.i2c.i2c_chip import I2cChip


@dataclass(frozen=True, kw_only=True)
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
    code_limits: tuple[int, int]
    """The largest numbers of the data format, at the range above."""
    registers: dict[int, int]
    """The configuration after opening, at the rate and range above."""
    commands: frozenset[int] = frozenset()
    """Registers that are written besides, and keep nothing."""
    has_self_test: bool = True
    has_gyro: bool = False
    temperature: Literal["follows", "fixed", "none"] = "follows"
    """What it reads of the temperature of the model."""
    resets_fifo: bool = False
    """Whether an interrupted burst costs the whole FIFO, because it may no longer begin with a sample."""

    def __str__(self) -> str:
        return self.kind
