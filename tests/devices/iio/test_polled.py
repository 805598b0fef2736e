"""Linux IIO devices that are read by their attributes, at a fake sysfs tree whose readings change with time."""

import math
from pathlib import Path

import numpy as np
import pytest

from devices.errors import DeviceError, DeviceNotFoundError
from devices.iio.polled import PolledIioAccelerometer
from tests.devices.i2c.i2c_chip import START_NS, FakeClock
from tests.devices.iio.iio_tree import ADXL355, IioTree

READ_S = 0.0008


class SensorClock(FakeClock):
    """Each look at the clock takes a part of the time of a read; the attributes follow the signal."""

    def __init__(self, tree: IioTree) -> None:
        super().__init__(oversleep_s=0.001)
        self.tree = tree

    def now_ns(self) -> int:
        self.pass_s(READ_S / 2)
        self.show()
        return self.time_ns

    def show(self) -> None:
        if self.tree.folder.exists():
            for axis, force_g in zip("xyz", swinging(self.elapsed_s), strict=True):
                (self.tree.folder / f"in_accel_{axis}_raw").write_text(f"{round(force_g * 256000)}\n")


def swinging(time_s: float) -> tuple[float, float, float]:
    phase = 2 * math.pi * 2.0 * time_s
    return 0.5 * math.sin(phase), 0.5 * math.cos(phase), 1.0 - 0.3 * math.sin(phase)


@pytest.fixture
def tree(tmp_path: Path) -> IioTree:
    return IioTree(tmp_path, {**ADXL355, "in_accel_x_raw": "0", "in_accel_y_raw": "0", "in_accel_z_raw": "0"})


def new_device(tree: IioTree, odr_hz: float = 100.0) -> PolledIioAccelerometer:
    return PolledIioAccelerometer("adxl355", clock=SensorClock(tree), odr_hz=odr_hz, root=tree.root)


@pytest.mark.slow
def test_the_axes_are_interpolated_to_common_instants(tree: IioTree) -> None:
    device = new_device(tree)
    info = device.open()
    blocks = [block for _ in range(20) if (block := device.read()) is not None]
    force_g = np.concatenate([block.raw for block in blocks]) / info.units_per_g
    time_s = (np.concatenate([block.time_ns for block in blocks]) - START_NS) / 1e9
    expected_g = np.array([swinging(at_s) for at_s in time_s])
    assert len(time_s) > 100
    assert np.abs(force_g - expected_g).max() < 0.004  # without the interpolation 2 ms are 13 mg
    assert np.allclose(np.diff(time_s), 0.01)
    assert blocks[0].temperature_c == pytest.approx(25 + (1795 - 1885) / -9.05, abs=0.01)
    assert not np.concatenate([block.saturated for block in blocks if block.saturated is not None]).any()


def test_a_part_that_is_slower_than_it_is_read_is_set_faster(tree: IioTree) -> None:
    tree.set("sampling_frequency", "3.906")
    assert new_device(tree).open().details["rate of the part"] == "250 Hz"
    assert tree.get("sampling_frequency") == "250"
    tree.set("sampling_frequency", "3.906")
    tree.set("sampling_frequency_available", "3.906 125")
    with pytest.raises(DeviceError, match=r"sampling_frequency: 3\.906 Hz, too slow for device\.odr_hz; it needs 200"):
        new_device(tree).open()


def test_a_part_that_vanishes_is_an_error(tree: IioTree) -> None:
    device = new_device(tree)
    device.open()
    tree.vanish()
    with pytest.raises(DeviceNotFoundError, match="in_accel_x_raw: no such attribute; is the sensor still there"):
        device.read()


def test_a_rate_that_cannot_be_read_is_refused(tree: IioTree) -> None:
    with pytest.raises(ValueError, match="give at most 200, or mode = 'buffer'"):
        new_device(tree, 400.0)
