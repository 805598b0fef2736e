"""The self-test of an accelerometer: an electrostatic force deflects its mass, and the output must change by a known amount."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from smbus2 import SMBus

from devices.clock import Clock
from devices.i2c.accelerometer_chip import AccelerometerChip, SelfTest, Setting
from devices.i2c.bus import BusOpener, I2cPart
from devices.i2c.fifo_accelerometer import FifoAccelerometer

SETTLING_S = 0.3
"""Basis: a choice; several samples at the rates of the test, and time for the low-pass of any chip."""
AVERAGING_S = 0.5
"""Basis: a choice; tens of samples, whose mean is far better than the limits."""


@dataclass(frozen=True, slots=True)
class SelfTestResult:
    """The change of the output of x, y and z, and what the data sheet allows."""

    change_g: tuple[float, float, float]
    limits_g: tuple[tuple[float, float], ...]
    confirmed: bool
    """Whether the limits are confirmed; others are a warning only."""

    @property
    def passed(self) -> bool:
        """Whether every axis is within its limits."""
        return all(low <= change <= high for change, (low, high) in zip(self.change_g, self.limits_g, strict=True))


def run_self_test(
    make_chip: Callable[[float, float], AccelerometerChip],
    test: SelfTest,
    bus: int,
    address: int,
    *,
    clock: Clock,
    open_bus: BusOpener = SMBus,
) -> SelfTestResult:
    """Measure the change of the output; the sensor must rest meanwhile. Raises `DeviceError`.

    The part is left with the self-test on, so it has to be opened again afterwards.
    """

    def mean_g(bits: int) -> NDArray[np.float64]:
        chip = make_chip(test.odr_hz, test.range_g)
        chip.configuration = _with_bits(chip.configuration, test.register, bits)
        return _mean_output_g(FifoAccelerometer(chip, bus, address, clock=clock, open_bus=open_bus), clock)

    change_g = mean_g(test.on_bits) - mean_g(test.off_bits)
    if test.either_sign:
        change_g = np.abs(change_g)
    part = I2cPart(bus, address, clock, open_bus)
    part.open()
    try:
        limits_g = test.limits_g(part)
    finally:
        part.close()
    x, y, z = change_g.tolist()
    return SelfTestResult((x, y, z), limits_g, test.confirmed)


def _with_bits(configuration: tuple[Setting, ...], register: int, bits: int) -> tuple[Setting, ...]:
    return tuple(
        Setting(setting.register, setting.name, setting.value | bits) if setting.register == register else setting
        for setting in configuration
    )


def _mean_output_g(device: FifoAccelerometer, clock: Clock) -> NDArray[np.float64]:
    """Open the part, wait until it has settled, and return the mean of its output, shape (3,)."""
    info = device.open()
    try:
        settled_ns = clock.now_ns() + round(SETTLING_S * 1e9)
        blocks = []
        while clock.now_ns() < settled_ns + round(AVERAGING_S * 1e9):
            block = device.read()
            if block is not None and block.time_ns[0] >= settled_ns:
                blocks.append(block.raw)
    finally:
        device.close()
    mean: NDArray[np.float64] = np.concatenate(blocks).mean(axis=0) / info.units_per_g
    return mean
