"""Every part against a model of its chip at the bus: opening, steady reading, sample times."""

import numpy as np
import pytest

from devices.errors import ConfigurationReadBackError, IdentityError, TransferError
from devices.i2c.chips import CHIPS
from tests.devices.i2c.part_rig import PARTS, Part, PartRig, numbered
from tests.values import present

each_part = pytest.mark.parametrize("part", PARTS, ids=str)


def test_every_kind_is_tested() -> None:
    assert {part.kind for part in PARTS} == set(CHIPS)


@each_part
def test_the_registers_after_opening_are_those_of_the_data_sheet(part: Part) -> None:
    rig = PartRig(part)
    rig.open()
    written = {register for kind, register, _ in rig.chip.log if kind == "write"}
    assert written == set(part.registers) | part.commands
    assert {register: rig.chip.registers.get(register) for register in part.registers} == part.registers


@each_part
def test_device_info_states_the_data_sheet(part: Part) -> None:
    info = PartRig(part).open()
    assert (info.kind, info.unit, info.odr_hz) == (part.kind, "counts", part.odr_hz)
    assert info.units_per_g == pytest.approx(part.units_per_g)
    assert info.full_scale_g == part.range_g
    assert info.device_id.startswith(f"{part.kind}-")


@each_part
def test_a_part_at_rest_reads_one_g_upwards(part: Part) -> None:
    rig = PartRig(part)
    rig.open()
    rig.read_s(1)
    assert np.abs(rig.raw - [0, 0, round(part.units_per_g)]).max() <= 1


@pytest.mark.slow
@each_part
@pytest.mark.parametrize("sign", [-1, 1])
def test_every_axis_keeps_its_sign(part: Part, sign: int) -> None:
    rig = PartRig(part, signal=lambda _: (0.25 * sign, -0.5 * sign, 0.75 * sign))
    rig.open()
    rig.read_s(1)
    expected = np.array([0.25, -0.5, 0.75]) * sign * part.units_per_g
    assert np.abs(rig.raw - expected).max() <= 1


@each_part
def test_a_reading_beyond_the_range_is_at_full_scale(part: Part) -> None:
    rig = PartRig(part, signal=lambda _: (100.0, -100.0, 0.0))
    info = rig.open()
    rig.read_s(1)
    assert info.full_scale_g is not None
    assert np.all(rig.raw[:, 0] >= 0.998 * info.full_scale_g * info.units_per_g)
    assert np.all(rig.raw[:, 1] <= -0.998 * info.full_scale_g * info.units_per_g)


@pytest.mark.slow
@each_part
def test_exactly_the_samples_beyond_the_range_are_marked_as_saturated(part: Part) -> None:
    lowest, highest = part.code_limits
    below, beyond = (highest - 2) / part.units_per_g, (highest + 50) / part.units_per_g
    for axis in range(3):

        def signal(time_s: float, axis: int = axis) -> tuple[float, float, float]:
            force_g = [0.0, 0.0, 0.0]
            force_g[axis] = beyond if time_s % 1.0 < 0.3 else -beyond if 0.5 < time_s % 1.0 < 0.7 else below
            return force_g[0], force_g[1], force_g[2]

        rig = PartRig(part, signal=signal)
        rig.open()
        rig.read_s(2)
        marks = np.concatenate([present(block.saturated) for block in rig.blocks])
        reached = (rig.raw[:, axis] >= highest) | (rig.raw[:, axis] <= lowest)
        assert np.array_equal(marks, reached)
        assert 0.4 < marks.mean() < 0.6
        assert rig.raw.max() == highest
        assert rig.raw.min() == lowest


@pytest.mark.slow
@each_part
def test_every_range_keeps_one_g(part: Part) -> None:
    for range_g in CHIPS[part.kind].ranges_g:
        rig = PartRig(part, range_g=range_g)
        info = rig.open()
        rig.read_s(0.5)
        assert info.full_scale_g == range_g
        assert np.abs(rig.raw / info.units_per_g - [0, 0, 1]).max() < 1.01 / info.units_per_g


@pytest.mark.slow
@each_part
def test_every_configurable_rate_is_the_rate_of_the_chip(part: Part) -> None:
    for rate_hz in CHIPS[part.kind].rates_hz:
        rig = PartRig(part, odr_hz=rate_hz)
        assert rig.open().odr_hz == pytest.approx(rate_hz)
        assert rig.chip.odr_hz == pytest.approx(rate_hz)


@pytest.mark.slow
@each_part
def test_every_sample_is_read_once_and_in_order_at_a_rate_error_of_five_per_cent(part: Part) -> None:
    for rate_error in (-0.05, 0.05):
        rig = PartRig(part, signal=numbered(part), rate_error=rate_error)
        rig.open()
        rig.read_s(30)
        assert (rig.lost, sum(rig.device.faults.values())) == (0, 0)
        made_ms = (np.array(rig.chip.made_ns[: rig.samples]) - rig.clock.start_ns) // 1_000_000
        assert np.array_equal(rig.made_ms(), made_ms)
        assert rig.samples >= len(rig.chip.made_ns) - rig.chip.fifo_places
        assert np.all(np.diff(rig.time_ns) > 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "rate_error"), [(part, 0.05 if number % 2 else -0.05) for number, part in enumerate(PARTS)], ids=str
)
def test_sample_times_are_right_to_a_fifth_of_a_millisecond_from_the_tenth_second(
    part: Part, rate_error: float
) -> None:
    """For 200 s; of the ten minutes that follow, the tests of the sample clock tell."""
    rig = PartRig(part, signal=numbered(part), rate_error=rate_error, oversleep_s=0.02)
    rig.open()
    rig.read_s(200)
    error_ms = rig.errors_ms()[rig.made_ms() > 10_000]
    assert np.sqrt(np.mean(error_ms**2)) < 0.2


@pytest.mark.slow
@each_part
@pytest.mark.parametrize("left", [0x15, 0x2A])
def test_a_part_that_another_program_has_configured_is_configured_anew(part: Part, left: int) -> None:
    rig = PartRig(part)
    identity = range(rig.identity.register, rig.identity.register + len(rig.identity.value))
    for register in set(range(0x19, 0x3A)) - set(identity):
        rig.chip.registers[register] = left
    rig.open()
    rig.read_s(1)
    assert rig.samples == pytest.approx(part.odr_hz, rel=0.2)
    assert np.abs(rig.raw - [0, 0, round(part.units_per_g)]).max() <= 1


@each_part
def test_another_part_at_the_address_is_refused(part: Part) -> None:
    rig = PartRig(part)
    register = rig.identity.register
    rig.chip.registers[register] = 0x5A
    with pytest.raises(IdentityError, match=f"5A.*{rig.identity.name}.*this is another part"):
        rig.open()
    assert rig.chip.closed


@each_part
def test_an_empty_address_is_reported(part: Part) -> None:
    rig = PartRig(part, address=0x42)
    with pytest.raises(TransferError, match="no acknowledge; check wiring, supply and address"):
        rig.open()


@each_part
def test_a_register_that_ignores_its_write_is_named(part: Part) -> None:
    for register in part.configured:
        rig = PartRig(part, range_g=part.other_range_g, odr_hz=part.other_odr_hz)
        rig.chip.deaf.add(register)
        with pytest.raises(ConfigurationReadBackError, match=rf"\({register:#04x}\)"):
            rig.open()
