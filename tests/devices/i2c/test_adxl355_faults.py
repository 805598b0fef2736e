"""The driver against a model of the chip at the bus, when things go wrong: overruns, lost transfers, a part that resets."""

import errno
import math
from collections.abc import Callable

import numpy as np
import pytest

from devices.errors import TransferError
from tests.devices.i2c.adxl355_rig import FIFO_DATA, LEVEL, POWER_CTL, RANGE, STATUS, Rig, telling_time


@pytest.mark.slow
@pytest.mark.parametrize("entries", [1, 2])
def test_missing_entries_lose_one_sample(rig: Callable[..., Rig], entries: int) -> None:
    made = rig(signal=telling_time, rate_error=-0.05)
    made.open()
    made.read_s(20)
    made.chip.run_s(0.05)
    made.chip.drop_places(entries)
    made.read_s(20)
    assert made.device.faults["broken_samples"] == 1
    assert made.lost == 1
    assert made.samples + 1 == len(made.chip.made_ns) - len(made.chip.fifo) // 3
    assert np.abs(made.error_ms()[made.made_at_s() > 10]).max() < 1  # none is mixed of two


def test_a_level_that_is_too_high_yields_no_invented_samples(rig: Callable[..., Rig]) -> None:
    made = rig(signal=telling_time)
    made.open()
    made.read_s(5)
    made.chip.level_error = 9
    made.read_s(5)
    assert np.all(np.diff(made.made_at_s()) > 0.007)
    assert made.lost == 0


@pytest.mark.slow
@pytest.mark.parametrize("popped", [0, 4, 21])
def test_an_interrupted_burst_loses_the_entries_that_it_removed(rig: Callable[..., Rig], popped: int) -> None:
    made = rig(signal=telling_time)
    made.open()
    made.read_s(5)
    made.chip.fail(errno.EIO, 1, register=FIFO_DATA, popped=popped)
    made.read_s(5)
    assert made.lost == math.ceil(popped / 3)
    assert np.abs(made.error_ms()[made.made_at_s() > 3]).max() < 8
    assert np.all(np.diff(made.time_ns) > 0)


def test_occasional_interrupted_bursts_are_tolerated(rig: Callable[..., Rig]) -> None:
    made = rig(signal=telling_time)
    made.open()
    made.read_s(2)
    for _ in range(5):
        made.chip.fail(errno.EIO, 1, register=FIFO_DATA, popped=3)
        made.read_s(2)
    assert made.lost == 5
    assert made.device.faults["i2c_bus_error"] == 5


def test_a_fifo_that_cannot_be_read_is_raised_in_bounded_time(rig: Callable[..., Rig]) -> None:
    made = rig()
    made.open()
    made.read_s(1)
    made.chip.fail(errno.EIO, 1000, register=FIFO_DATA)
    start_s = made.clock.elapsed_s
    with pytest.raises(TransferError, match="I2C bus 1 address 0x1d"):
        made.read_s(10)
    assert made.clock.elapsed_s - start_s < 2


def test_read_returns_none_after_half_a_second_without_samples(rig: Callable[..., Rig]) -> None:
    made = rig()
    made.open()
    made.read_s(1)
    made.chip.oscillating = False
    while made.device.read() is not None:
        pass
    start_s = made.clock.elapsed_s
    assert made.device.read() is None
    assert 0.4 < made.clock.elapsed_s - start_s < 0.6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("register", "bits"),
    [(STATUS, [0x10]), (STATUS, [0x80]), (STATUS, [0xE0]), (LEVEL, [0x60]), (RANGE, [0x02]), (POWER_CTL, [0x01])],
)
def test_one_disturbed_reading_is_tolerated(rig: Callable[..., Rig], register: int, bits: list[int]) -> None:
    made = rig(signal=telling_time)
    made.open()
    made.read_s(2)
    made.chip.disturbed[register] = bits
    made.read_s(2)
    assert made.device.faults.get("nonsense_status", 0) == (register in {STATUS, LEVEL})
    assert made.chip.disturbed[register] == []
    assert made.lost == 0
    assert np.all(np.diff(made.made_at_s()) < 0.009)


def test_a_level_within_a_sample_loses_nothing(rig: Callable[..., Rig]) -> None:
    made = rig(signal=telling_time)
    made.open()
    made.read_s(2)
    for missing in (-1, -2, 0, -1):
        made.chip.level_error = missing
        made.read_s(1)
    assert made.lost == 0
    assert np.all(np.diff(made.made_at_s()) < 0.009)
