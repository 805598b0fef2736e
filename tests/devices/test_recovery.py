"""Recovery in steps: what is tried after which number of failures, what is counted, and how long it takes."""

import errno
from collections.abc import Callable
from contextlib import suppress

import pytest

from devices.errors import DeviceError
from devices.recovery import RecoveringDevice
from gateway.daemon.runtime.worker import Backoff
from gateway.daemon.sampling.sampler import MAX_REOPENING_PAUSE_S, MIN_REOPENING_PAUSE_S
from tests.devices.i2c.part_rig import PARTS, Part, PartRig

each_part = pytest.mark.parametrize("part", PARTS, ids=str)


def done(step: Callable[[], None]) -> Callable[[], bool]:
    def hook() -> bool:
        step()
        return True

    return hook


def open_again(rig: PartRig, device: RecoveringDevice, at_most_s: float = 60.0) -> None:
    """Try to open the device with the pauses of the sampling thread."""
    backoff = Backoff(MIN_REOPENING_PAUSE_S, MAX_REOPENING_PAUSE_S)
    end_s = rig.clock.elapsed_s + at_most_s
    while True:
        rig.clock.sleep_s(backoff.pause_s)
        device.close()
        try:
            device.open()
        except DeviceError:
            if rig.clock.elapsed_s > end_s:
                raise
            backoff.increase()
        else:
            return


def read_until_it_fails(device: RecoveringDevice) -> None:
    with suppress(DeviceError):
        while True:
            device.read()


def await_sample(rig: PartRig, device: RecoveringDevice) -> None:
    while device.read() is None:
        assert rig.clock.elapsed_s < 1000


@pytest.mark.slow
@each_part
@pytest.mark.parametrize("away_s", [20.0, 20.15, 20.3, 20.45])
def test_a_part_that_returns_delivers_samples_within_a_second(part: Part, away_s: float) -> None:
    rig = PartRig(part)
    device = RecoveringDevice(rig.device, rig.clock)
    device.open()
    await_sample(rig, device)
    rig.chip.absent_until_s = rig.clock.elapsed_s + away_s
    read_until_it_fails(device)
    rig.chip.brown_out()
    open_again(rig, device)
    await_sample(rig, device)
    assert 0 < rig.clock.elapsed_s - rig.chip.absent_until_s < 1
    assert device.faults["reinitialised"] > 20


@each_part
def test_a_part_that_holds_sda_low_is_freed_by_clearing_the_bus(part: Part) -> None:
    rig = PartRig(part)
    device = RecoveringDevice(
        rig.device, rig.clock, bus_clear=done(rig.chip.clear_bus), power_cycle=done(rig.chip.power_cycle)
    )
    device.open()
    await_sample(rig, device)
    rig.chip.sda_low = True
    read_until_it_fails(device)
    open_again(rig, device)
    await_sample(rig, device)
    assert device.faults["bus_cleared"] == 1
    assert device.faults["reinitialised"] == 3
    assert "power_cycled" not in device.faults


@each_part
def test_a_part_that_only_a_power_cycle_frees(part: Part) -> None:
    rig = PartRig(part)
    device = RecoveringDevice(
        rig.device, rig.clock, bus_clear=done(lambda: None), power_cycle=done(rig.chip.power_cycle)
    )
    device.open()
    rig.chip.sda_low = True
    read_until_it_fails(device)
    open_again(rig, device)
    await_sample(rig, device)
    assert (device.faults["bus_cleared"], device.faults["power_cycled"]) == (2, 1)
    assert device.faults["i2c_time_out"] >= 5


def test_a_hook_that_fails_is_counted_as_such() -> None:
    rig = PartRig(PARTS[0])
    device = RecoveringDevice(rig.device, rig.clock, bus_clear=lambda: False)
    device.open()
    rig.chip.fail(errno.ETIMEDOUT, 3)
    read_until_it_fails(device)
    open_again(rig, device)
    assert device.faults["recovery_hook_failed"] == 1
    assert "bus_cleared" not in device.faults


def test_without_hooks_the_device_is_only_opened_again() -> None:
    rig = PartRig(PARTS[0])
    device = RecoveringDevice(rig.device, rig.clock)
    device.open()
    rig.chip.fail(errno.ETIMEDOUT, 8)
    read_until_it_fails(device)
    open_again(rig, device)
    assert device.faults["reinitialised"] == 8
    assert not {"bus_cleared", "power_cycled", "recovery_hook_failed"} & set(device.faults)


def test_the_first_opening_is_no_recovery() -> None:
    rig = PartRig(PARTS[0])
    device = RecoveringDevice(rig.device, rig.clock, bus_clear=lambda: False)
    device.open()
    assert sum(device.faults.values()) == 0
