"""Every part against a model of its chip at the bus, when things go wrong on the wires or in the chip."""

import errno
from typing import Any

import numpy as np
import pytest

from devices.errors import ConfigurationReadBackError, DeviceError, TransferError
from tests.devices.i2c.part_rig import PARTS, Part, PartRig, numbered

pytestmark = pytest.mark.slow

each_part = pytest.mark.parametrize("part", PARTS, ids=str)


def running(part: Part, seconds: float = 3.0, **chip: Any) -> PartRig:
    rig = PartRig(part, signal=numbered(part), **chip)
    rig.open()
    rig.read_s(seconds)
    return rig


def no_sample_is_invented(rig: PartRig) -> bool:
    """Whether every sample is one that the chip made, each at most once and in order."""
    made_ms = (np.array(rig.chip.made_ns) - rig.clock.start_ns) // 1_000_000
    came_ms = rig.made_ms()
    return bool(np.isin(came_ms, made_ms).all() and np.all(np.diff(came_ms) > 0) and np.all(np.diff(rig.time_ns) > 0))


@each_part
@pytest.mark.parametrize(("number", "name"), [(errno.EREMOTEIO, "i2c_no_acknowledge"), (errno.EAGAIN, "i2c_bus_error")])
def test_a_transfer_that_fails_twice_loses_nothing(part: Part, number: int, name: str) -> None:
    rig = running(part)
    rig.chip.fail(number, 2, register=part.level_registers[0])
    rig.read_s(3)
    assert rig.device.faults[name] == 2
    assert rig.lost == 0
    assert no_sample_is_invented(rig)


@each_part
def test_a_fifo_that_does_not_acknowledge_twice_loses_nothing(part: Part) -> None:
    rig = running(part)
    rig.chip.fail(errno.EREMOTEIO, 2, register=rig.chip.fifo_register)
    rig.read_s(3)
    assert rig.device.faults["i2c_no_acknowledge"] == 2
    assert rig.lost == 0
    assert no_sample_is_invented(rig)


@each_part
@pytest.mark.parametrize("number", [errno.EREMOTEIO, errno.ETIMEDOUT, errno.EIO])
def test_a_dead_bus_is_raised_within_two_seconds(part: Part, number: int) -> None:
    rig = running(part)
    rig.chip.fail(number, 10_000)
    start_s = rig.clock.elapsed_s
    with pytest.raises(TransferError, match="I2C bus 1 address"):
        rig.read_s(10)
    assert rig.clock.elapsed_s - start_s < 2
    assert no_sample_is_invented(rig)


@each_part
def test_a_bus_that_reads_ones_gives_no_data(part: Part) -> None:
    rig = running(part)
    samples = rig.samples
    rig.chip.stuck_high = True
    with pytest.raises(ConfigurationReadBackError, match="reads 0xff"):
        rig.read_s(10)
    assert rig.samples == samples


@each_part
def test_a_burst_of_ones_gives_no_data(part: Part) -> None:
    """Only the FIFO is read as ones: its status was right."""
    rig = running(part)
    rig.chip.high_bursts = 1
    rig.read_s(3)
    assert rig.chip.high_bursts == 0
    assert no_sample_is_invented(rig)
    assert rig.lost + rig.samples >= len(rig.chip.made_ns) - rig.chip.fifo_places - 1


@each_part
@pytest.mark.parametrize("bit", range(8))
def test_a_bit_that_turns_over_in_the_level_of_the_fifo_invents_no_sample(part: Part, bit: int) -> None:
    for register in part.level_registers:
        rig = running(part)
        rig.chip.disturbed[register] = [1 << bit]
        rig.read_s(3)
        assert rig.chip.disturbed[register] == []
        assert no_sample_is_invented(rig)


@pytest.mark.parametrize("part", [part for part in PARTS if part.chip.places_per_sample > 1], ids=str)
def test_a_fifo_that_loses_alignment_is_read_in_step_again(part: Part) -> None:
    for places in range(1, part.chip.places_per_sample):
        rig = running(part, 5)
        rig.chip.run_s(0.05)
        rig.chip.drop_places(places)
        rig.read_s(3)
        assert rig.device.faults.get("misaligned", 0) + rig.device.faults.get("broken_samples", 0) == 1
        assert rig.lost >= 1
        assert np.diff(rig.made_ms())[-100:].max() <= 1000 / rig.odr_hz + 1
        assert no_sample_is_invented(rig)


@each_part
def test_a_bit_that_turns_over_in_one_check_of_the_configuration_is_tolerated(part: Part) -> None:
    rig = running(part)
    for register in part.configured:
        rig.chip.disturbed[register] = [0x01]
    rig.read_s(3)
    assert all(not rig.chip.disturbed[register] for register in part.configured)
    assert rig.lost == 0
    assert no_sample_is_invented(rig)


@each_part
def test_a_brown_out_is_detected_and_the_part_comes_back_within_a_second(part: Part) -> None:
    rig = running(part)
    rig.chip.brown_out()
    start_s = rig.clock.elapsed_s
    with pytest.raises(ConfigurationReadBackError, match="lost its configuration"):
        rig.read_s(10)
    assert rig.clock.elapsed_s - start_s < 2
    assert rig.device.faults["configuration_lost"] == 1
    reopened_s = rig.clock.elapsed_s
    rig.open()
    while not rig.read_s(0.001):
        pass
    assert rig.clock.elapsed_s - reopened_s < 1


@each_part
def test_a_register_that_changes_while_sampling_is_detected(part: Part) -> None:
    for register in part.configured:
        rig = running(part)
        rig.chip.registers[register] ^= 0x03 if register != part.configured[-1] else 0xFF
        with pytest.raises(ConfigurationReadBackError, match=rf"\({register:#04x}\)"):
            rig.read_s(3)


@each_part
@pytest.mark.parametrize("rate_error", [-0.05, 0.05])
def test_an_overrun_is_counted_and_its_length_follows_from_the_times(part: Part, rate_error: float) -> None:
    rig = running(part, 20, rate_error=rate_error)
    rig.chip.run_s(2)
    rig.read_s(5)
    assert rig.device.faults["overrun"] == 1
    missing = len(rig.chip.made_ns) - rig.samples
    assert -1 <= missing - rig.lost <= rig.chip.fifo_places + 1
    gaps = np.diff(rig.made_ms())
    assert rig.lost == pytest.approx(gaps.max() * rig.chip.odr_hz / 1000 - 1, abs=1)
    assert no_sample_is_invented(rig)


@each_part
@pytest.mark.parametrize("popped", [0, 1])
def test_an_interrupted_burst_loses_what_it_removed(part: Part, popped: int) -> None:
    rig = running(part, 5)
    per_sample = rig.chip.places_per_sample
    rig.chip.fail(errno.EIO, 1, register=rig.chip.fifo_register, popped=popped * per_sample)
    rig.read_s(5)
    assert rig.lost == popped or (part.resets_fifo and popped <= rig.lost <= 20)
    assert no_sample_is_invented(rig)


@each_part
def test_a_part_that_holds_sda_low_is_reported_and_usable_once_it_lets_go(part: Part) -> None:
    rig = running(part)
    rig.chip.sda_low = True
    with pytest.raises(TransferError, match="time-out, a part holds the bus"):
        rig.read_s(10)
    with pytest.raises(TransferError):
        rig.open()
    rig.chip.clear_bus()
    rig.open()
    assert rig.read_s(1)
    assert no_sample_is_invented(rig)


@each_part
def test_a_part_without_samples_is_reported_after_two_seconds(part: Part) -> None:
    rig = running(part)
    rig.chip.oscillating = False
    start_s = rig.clock.elapsed_s
    with pytest.raises(TransferError, match="no samples for 2 s; power-cycle the sensor"):
        rig.read_s(10)
    assert 2 < rig.clock.elapsed_s - start_s < 3


@each_part
def test_random_faults_are_survived_or_raised_and_never_invent_a_sample(part: Part) -> None:
    """One fault a second of any kind for a minute; the device is opened again whenever it raises."""
    random = np.random.default_rng(3)
    rig = running(part)
    for _ in range(60):
        fault = random.choice(["nack", "time_out", "io", "brown_out", "overrun", "flip"])
        if fault == "nack":
            rig.chip.fail(errno.EREMOTEIO, int(random.integers(1, 5)))
        elif fault == "time_out":
            rig.chip.fail(errno.ETIMEDOUT)
        elif fault == "io":
            rig.chip.fail(errno.EIO, 1, register=rig.chip.fifo_register)
        elif fault == "brown_out":
            rig.chip.brown_out()
        elif fault == "overrun":
            rig.chip.run_s(1)
        else:
            rig.chip.disturbed[part.level_registers[-1]] = [1 << int(random.integers(8))]
        try:
            rig.read_s(1)
        except DeviceError:
            rig.chip.recover()
            rig.open()
    assert no_sample_is_invented(rig)
    assert rig.samples > 10 * rig.odr_hz
