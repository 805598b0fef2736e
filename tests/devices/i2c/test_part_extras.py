"""What only some parts have: a gyroscope, a temperature sensor, several identities."""

import numpy as np
import pytest

from devices.errors import IdentityError
from tests.devices.i2c.part_rig import PARTS, PartRig
from tests.values import present

KINDS = {part.kind: part for part in PARTS}


@pytest.mark.parametrize("kind", [part.kind for part in PARTS if part.has_gyro])
def test_blocks_of_a_part_with_a_gyroscope_contain_its_rates(kind: str) -> None:
    rig = PartRig(KINDS[kind])
    rig.chip.rates_deg_s = (10.0, -20.0, 200.0)
    info = rig.open()
    rig.read_s(1)
    counts = np.concatenate([block.gyro_counts for block in rig.blocks if block.gyro_counts is not None])
    rates_rad_s = counts * present(info.gyro_rad_s_per_count)
    assert rates_rad_s.shape == rig.raw.shape
    assert np.degrees(rates_rad_s) == pytest.approx(np.tile([10.0, -20.0, 200.0], (len(rates_rad_s), 1)), abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [part.kind for part in PARTS if not part.has_gyro])
def test_blocks_of_a_part_without_a_gyroscope_contain_no_rates(kind: str) -> None:
    rig = PartRig(KINDS[kind])
    rig.open()
    rig.read_s(1)
    assert {block.gyro_counts is None for block in rig.blocks} == {True}


@pytest.mark.slow
@pytest.mark.parametrize("kind", [part.kind for part in PARTS if part.temperature == "follows"])
@pytest.mark.parametrize("temperature_c", [-20.0, 25.0, 60.0])
def test_blocks_contain_the_temperature(kind: str, temperature_c: float) -> None:
    rig = PartRig(KINDS[kind])
    rig.chip.temperature_c = temperature_c
    rig.open()
    rig.read_s(1)
    assert [block.temperature_c for block in rig.blocks] == pytest.approx([temperature_c] * len(rig.blocks), abs=0.04)


@pytest.mark.parametrize("kind", [part.kind for part in PARTS if part.temperature == "none"])
def test_a_part_without_a_temperature_delivers_none(kind: str) -> None:
    rig = PartRig(KINDS[kind])
    rig.open()
    rig.read_s(1)
    assert {block.temperature_c for block in rig.blocks} == {None}


@pytest.mark.parametrize(("identity", "accepted"), [(0x71, True), (0x73, True), (0x70, True), (0x68, False)])
def test_the_members_of_the_mpu_9250_family_are_accepted(identity: int, accepted: bool) -> None:
    rig = PartRig(KINDS["mpu9250"])
    rig.chip.registers[0x75] = identity
    if accepted:
        assert rig.open().device_id == f"mpu9250-{identity:02x}-i2c1-68"
    else:
        with pytest.raises(IdentityError, match="this is an MPU-6050"):
            rig.open()
