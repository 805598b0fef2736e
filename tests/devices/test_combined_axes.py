"""Three chips on their buses, one axis of each, as one triaxial accelerometer."""

import errno
import math
from typing import Any

import numpy as np
import pytest

from devices.block import SampleBlock
from devices.combined_axes import CombinedAxes, SensitiveAxis
from devices.errors import TransferError
from devices.i2c.chips import CHIPS
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from tests.devices.i2c.adxl345_chip import Adxl345Chip
from tests.devices.i2c.i2c_chip import START_NS, FakeClock, Signal
from tests.values import present

PLACES = ((0, 1), (2, -1), (1, 1))
"""Index and sign of the sensitive axis of each part."""


def force_g(time_s: float) -> tuple[float, float, float]:
    phase = 2 * math.pi * 1.5 * time_s
    return 0.5 * math.sin(phase), 0.4 * math.cos(phase), 1.0 - 0.3 * math.sin(phase)


class Cube:
    def __init__(self, full_scale_from_s: float = math.inf) -> None:
        self.clock = FakeClock(0.0002)
        self.full_scale_from_s = full_scale_from_s
        self.chips = [
            Adxl345Chip(self.clock, self.signal(axis), rate_error=error)
            for axis, error in enumerate((0.03, -0.02, 0.0))
        ]
        axes = [
            SensitiveAxis(self.driver(chip), index, sign)
            for chip, (index, sign) in zip(self.chips, PLACES, strict=True)
        ]
        self.device = CombinedAxes(axes, odr_hz=100.0, serial="CUBE-1")
        self.blocks: list[SampleBlock] = []

    def signal(self, axis: int) -> Signal:
        index, sign = PLACES[axis]

        def part(time_s: float) -> tuple[float, float, float]:
            found = [0.9, 0.9, 0.9]  # what the other axes of the part read must not matter
            found[index] = 5.0 if axis == 1 and time_s > self.full_scale_from_s else sign * force_g(time_s)[axis]
            return found[0], found[1], found[2]

        return part

    def driver(self, chip: Adxl345Chip) -> FifoAccelerometer:
        def open_bus(_: int) -> Adxl345Chip:
            chip.closed = False
            return chip

        return FifoAccelerometer(CHIPS["adxl345"](100.0, 2), 1, 0x53, clock=self.clock, open_bus=open_bus)

    def read_s(self, seconds: float) -> None:
        until_s = self.clock.elapsed_s + seconds
        while self.clock.elapsed_s < until_s:
            if (block := self.device.read()) is not None:
                self.blocks.append(block)

    @property
    def time_s(self) -> Any:
        return (np.concatenate([block.time_ns for block in self.blocks]) - START_NS) / 1e9

    @property
    def error_g(self) -> Any:
        true_g = np.array([force_g(at_s) for at_s in self.time_s])
        return np.concatenate([block.raw for block in self.blocks]) - true_g


@pytest.mark.slow
def test_the_axes_are_read_at_common_instants_whatever_the_clocks_of_the_parts() -> None:
    cube = Cube()
    info = cube.device.open()
    assert (info.kind, info.device_id, info.unit, info.full_scale_g) == ("single_axis", "single-axis-CUBE-1", "g", 2.0)
    assert info.zero_g_offset_g == 0.25
    cube.read_s(20)
    settled = cube.time_s > 5
    assert np.allclose(np.diff(cube.time_s), 0.01)
    assert np.sqrt(np.mean(cube.error_g[settled] ** 2)) < 0.003  # of 4 mg; a skew of 5 ms is 24 mg
    assert sum(block.lost for block in cube.blocks) == 0


@pytest.mark.slow
def test_a_late_host_leaves_a_gap_of_known_length() -> None:
    cube = Cube()
    cube.device.open()
    cube.read_s(5)
    cube.clock.pass_s(0.8)  # the FIFOs hold a third of a second
    cube.read_s(5)
    steps = np.rint(np.diff(cube.time_s) / 0.01).astype(int)
    assert sum(block.lost for block in cube.blocks) == (steps - 1).sum() > 30
    assert np.abs(cube.error_g[cube.time_s > 2]).max() < 0.05


@pytest.mark.slow
def test_a_saturated_axis_marks_the_sample() -> None:
    cube = Cube(full_scale_from_s=4.0)
    cube.device.open()
    cube.read_s(6)
    marks = np.concatenate([present(block.saturated) for block in cube.blocks])
    assert marks[cube.time_s > 4.05].all()
    assert not marks[cube.time_s < 3.95].any()


def test_an_error_names_its_axis() -> None:
    cube = Cube()
    cube.device.open()
    cube.chips[2].fail(errno.EREMOTEIO, times=1000)
    with pytest.raises(TransferError, match=r"axis z: .*no acknowledge"):
        cube.read_s(1)
