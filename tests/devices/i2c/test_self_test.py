"""The self-test of every part that has one, and the search for parts on a bus."""

import errno
from dataclasses import replace
from typing import Any, ClassVar

import pytest

from devices.errors import DeviceNotFoundError
from devices.i2c.bus import probe_bus
from devices.i2c.chips import CHIPS
from devices.i2c.self_test import run_self_test
from tests.devices.i2c.ads1115_chip import Ads1115Chip
from tests.devices.i2c.adxl345_chip import Adxl345Chip
from tests.devices.i2c.adxl355_chip import Adxl355Chip
from tests.devices.i2c.chip_bus import ChipBus
from tests.devices.i2c.i2c_chip import FakeClock
from tests.devices.i2c.lis3dh_chip import Lis3dhChip
from tests.devices.i2c.mpu9250_chip import Mpu9250Chip
from tests.devices.i2c.part_rig import PARTS, Part, PartRig

TESTED = [part for part in PARTS if CHIPS[part.kind](part.odr_hz, part.range_g).self_test is not None]


class TrimmedChip(Mpu9250Chip):
    """With the responses that its maker has stored."""

    power_on: ClassVar = {**Mpu9250Chip.power_on, 0x0D: 0, 0x0E: 1, 0x0F: 110}


def self_tested(part: Part, deflection_g: tuple[float, float, float]) -> Any:
    rig = PartRig(part, signal=lambda _: (0.1, -0.2, 0.95))
    rig.chip.self_test_g = deflection_g
    test = CHIPS[part.kind](part.odr_hz, part.range_g).self_test
    assert test is not None
    address = rig.chip.address
    return run_self_test(CHIPS[part.kind], test, 1, address, clock=rig.clock, open_bus=rig.open_bus), rig


def test_the_parts_with_a_self_test_are_known() -> None:
    assert [part for part in PARTS if part.has_self_test] == TESTED


@pytest.mark.parametrize("part", TESTED, ids=str)
def test_a_part_within_the_limits_passes_and_samples_afterwards(part: Part) -> None:
    result, rig = self_tested(part, (0.4, -0.4, 0.6))
    assert result.passed
    signs = (1, -1, 1) if part.kind == "adxl345" else (1, 1, 1)
    assert result.change_g == pytest.approx([0.4 * signs[0], 0.4 * signs[1], 0.6 * signs[2]], abs=0.01)
    rig.open()
    rig.read_s(1)
    assert rig.raw[-1] / part.units_per_g == pytest.approx([0.1, -0.2, 0.95], abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("part", TESTED, ids=str)
@pytest.mark.parametrize("axis", range(3))
def test_an_axis_that_does_not_move_fails(part: Part, axis: int) -> None:
    deflection_g = [0.4, -0.4, 0.6]
    deflection_g[axis] = 0.03
    x, y, z = deflection_g
    assert not self_tested(part, (x, y, z))[0].passed


def test_the_limits_of_an_mpu_9250_are_those_that_it_contains() -> None:
    part = next(part for part in PARTS if part.kind == "mpu9250")
    rig = PartRig(replace(part, chip=TrimmedChip))
    test = CHIPS["mpu9250"](100.0, 2).self_test
    assert test is not None
    result = run_self_test(CHIPS["mpu9250"], test, 1, 0x68, clock=rig.clock, open_bus=rig.open_bus)
    one_g, top_g = 2620 / 16384, 2620 * 1.01**109 / 16384
    expected = [(0.225, 0.675), (0.5 * one_g, 1.5 * one_g), (0.5 * top_g, 1.5 * top_g)]
    assert [limits for axis in result.limits_g for limits in axis] == pytest.approx(
        [v for axis in expected for v in axis]
    )


def test_every_part_on_the_bus_is_found_by_its_identity() -> None:
    clock = FakeClock()
    chips = (
        Adxl345Chip(clock, address=0x1D),
        Adxl355Chip(clock, address=0x53),
        Lis3dhChip(clock, address=0x19),
        Mpu9250Chip(clock),
        Ads1115Chip(clock, address=0x4A),
    )
    found = {part.address: part.identity.name for part in probe_bus(1, clock, ChipBus(clock, *chips)) if part.identity}
    assert found == {0x1D: "ADXL345", 0x53: "ADXL355", 0x19: "LIS3DH", 0x68: "MPU-9250", 0x4A: "ADS1115"}


def test_an_unknown_part_and_one_that_disturbs_the_bus_are_listed_without_a_name() -> None:
    clock = FakeClock()
    unknown, broken = Lis3dhChip(clock, address=0x18), Mpu9250Chip(clock, address=0x69)
    unknown.registers[0x0F] = 0x99
    broken.fail(errno.EIO, 100)
    first, second = probe_bus(1, clock, ChipBus(clock, unknown, broken))
    assert (first.address, first.identity, first.error) == (0x18, None, None)
    assert (second.address, second.identity) == (0x69, None)
    assert second.error is not None
    assert "bus error" in second.error


def test_an_empty_bus_yields_nothing() -> None:
    clock = FakeClock()
    assert list(probe_bus(1, clock, ChipBus(clock))) == []


def test_a_missing_bus_is_reported() -> None:
    clock = FakeClock()
    with pytest.raises(DeviceNotFoundError, match="/dev/i2c-3: no such bus"):
        list(probe_bus(3, clock, ChipBus(clock)))
