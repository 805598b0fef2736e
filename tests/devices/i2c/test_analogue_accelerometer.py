"""Analogue accelerometers behind an ADS1115 against a model of both at the bus."""

import errno
import math
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.channel_cycles import interpolate_channels
from devices.errors import ConfigurationReadBackError, DeviceError, IdentityError, TransferError
from devices.i2c.analogue_accelerometer import (
    ADXL327,
    ADXL335,
    ANALOGUE_PARTS,
    LIS344ALH,
    AnalogueAccelerometer,
    AnaloguePart,
)
from gateway.bench.thermal.ramp_calibration import LIMITS_BY_PART
from tests.devices.i2c.ads1115_chip import Ads1115Chip
from tests.devices.i2c.i2c_chip import START_NS, FakeClock
from tests.values import present

each_part = pytest.mark.parametrize("sensor", [ADXL335, ADXL327, LIS344ALH], ids=lambda sensor: sensor.name)


class AnalogueRig:
    def __init__(
        self, sensor: AnaloguePart = ADXL335, *, odr_hz: float = 100.0, oversleep_s: float = 0.0001, **chip: Any
    ) -> None:
        self.clock = FakeClock(oversleep_s)
        self.chip = Ads1115Chip(self.clock, **chip)
        self.chip.sensitivity_v_per_g = sensor.sensitivity_v_per_g
        self.device = AnalogueAccelerometer(sensor, 1, 0x48, clock=self.clock, odr_hz=odr_hz, open_bus=self.open_bus)
        self.blocks: list[SampleBlock] = []

    def open_bus(self, number: int) -> Ads1115Chip:
        self.chip.closed = False
        return self.chip

    def open(self) -> DeviceInfo:
        self.info = self.device.open()
        return self.info

    def read_s(self, seconds: float) -> None:
        until_s = self.clock.elapsed_s + seconds
        while self.clock.elapsed_s < until_s:
            block = self.device.read()
            if block is not None:
                self.blocks.append(block)

    @property
    def force_g(self) -> Any:
        return np.concatenate([block.raw for block in self.blocks]) / self.info.units_per_g

    @property
    def time_s(self) -> Any:
        return (np.concatenate([block.time_ns for block in self.blocks]) - START_NS) / 1e9


def swinging(time_s: float) -> tuple[float, float, float]:
    """Fast enough that the time between two inputs matters: 6 ms are 38 mg."""
    phase = 2 * math.pi * 2.0 * time_s
    return 0.5 * math.sin(phase), 0.5 * math.cos(phase), 1.0 - 0.3 * math.sin(phase)


@pytest.mark.slow
@each_part
@pytest.mark.parametrize("supply_v", [3.0, 3.3, 2.7])
def test_a_sensor_at_rest_reads_one_g_at_any_supply(sensor: AnaloguePart, supply_v: float) -> None:
    rig = AnalogueRig(sensor)
    rig.chip.supply_v = supply_v
    rig.open()
    rig.read_s(1)
    assert rig.force_g == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(rig.force_g), 1)), abs=1e-3)


@pytest.mark.slow
@each_part
def test_samples_beyond_what_the_data_sheet_promises_are_marked_as_saturated(sensor: AnaloguePart) -> None:
    beyond_g = 1.1 * sensor.full_scale_g
    rig = AnalogueRig(sensor, signal=lambda time_s: (beyond_g if 0.5 < time_s < 0.7 else 0.2, 0.0, 1.0))
    rig.open()
    rig.read_s(1.5)
    marks = np.concatenate([present(block.saturated) for block in rig.blocks])
    time_s = rig.time_s
    assert np.all(marks[(time_s > 0.5) & (time_s < 0.7)])
    assert not np.any(marks[(time_s < 0.47) | (time_s > 0.73)])


@each_part
def test_device_info_states_the_data_sheet(sensor: AnaloguePart) -> None:
    info = AnalogueRig(sensor).open()
    assert (info.kind, info.device_id) == ("ads1115", f"{sensor.name.lower()}-i2c1-48")
    assert info.units_per_g == pytest.approx(sensor.sensitivity_v_per_g / 1e-5)
    assert info.details["supply"] == "3.00 V"


@pytest.mark.slow
@pytest.mark.parametrize("oversleep_s", [0.0001, 0.003])
def test_the_inputs_are_read_at_one_instant(oversleep_s: float) -> None:
    rig = AnalogueRig(signal=swinging, oversleep_s=oversleep_s, odr_hz=50.0)
    rig.open()
    rig.read_s(10)
    expected_g = np.array([swinging(time_s) for time_s in rig.time_s])
    error_g = rig.force_g - expected_g
    assert (
        np.abs(error_g).max() < (2 * math.pi * 2) ** 2 * 0.5 * 0.025**2 / 8 + 2e-3
    )  # chord of the sine, and the steps


@pytest.mark.slow
def test_samples_are_evenly_spaced_at_the_configured_rate_over_blocks() -> None:
    rig = AnalogueRig(odr_hz=125.0, oversleep_s=0.0001)
    rig.open()
    rig.read_s(10)
    assert np.ptp(np.diff(rig.time_s)) < 1e-6
    assert 1 / np.diff(rig.time_s).mean() == pytest.approx(125.0)
    assert len(rig.time_s) == pytest.approx(1250, abs=15)
    assert sum(block.lost for block in rig.blocks) == 0
    assert sum(rig.device.faults.values()) == 0


@pytest.mark.slow
def test_a_slow_converter_only_delays() -> None:
    for rate_error in (-0.1, 0.1):
        rig = AnalogueRig(signal=swinging, rate_error=rate_error)
        rig.open()
        rig.read_s(5)
        expected_g = np.array([swinging(time_s) for time_s in rig.time_s])
        assert np.abs(rig.force_g - expected_g).max() < 0.012


@pytest.mark.slow
def test_a_pause_of_the_host_is_a_gap_and_not_a_line() -> None:
    rig = AnalogueRig()
    rig.open()
    rig.read_s(2)
    rig.clock.pass_s(1.0)
    rig.read_s(2)
    assert sum(block.lost for block in rig.blocks) == pytest.approx(100, abs=3)
    assert np.diff(rig.time_s).max() > 0.98
    for block in rig.blocks:
        assert np.all(np.diff(block.time_ns) == 10_000_000)


def test_a_rate_that_four_inputs_do_not_reach_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot convert four inputs at 200 Hz; give at most 125"):
        AnalogueRig(odr_hz=200.0)


def test_a_sensor_whose_supply_is_not_connected_is_reported() -> None:
    rig = AnalogueRig()
    rig.chip.supply_v = 0.02
    with pytest.raises(DeviceError, match=r"input 3 reads 0\.02 V.*ADXL335 is 1\.8 to 3\.6 V; connect"):
        rig.open()
    assert rig.chip.closed


@pytest.mark.slow
def test_a_supply_that_fails_is_reported_and_yields_no_samples() -> None:
    rig = AnalogueRig()
    rig.open()
    rig.read_s(2)
    samples = len(rig.force_g)
    rig.chip.supply_v = 0.5
    with pytest.raises(DeviceError, match="connect the sensor's supply"):
        rig.read_s(5)
    assert rig.device.faults["supply_voltage"] == 10
    assert len(rig.force_g) - samples <= 9
    assert np.abs(rig.force_g[:, 2] - 1).max() < 0.01


def test_an_output_that_the_data_sheet_excludes_is_counted() -> None:
    rig = AnalogueRig(signal=lambda _: (-5.0, 0.0, 1.0))  # an open input
    rig.open()
    rig.read_s(1)
    assert rig.device.faults["implausible_voltage"] >= 90


@pytest.mark.parametrize("name", ["ADXL335", "ADXL327", "LIS344ALH"])
def test_the_limits_are_those_of_the_thermal_evaluation(name: str) -> None:
    part, limits = ANALOGUE_PARTS[name], LIMITS_BY_PART[name]
    assert limits.sensitivity == part.sensitivity_limits_v_per_g
    assert limits.zero_g == part.zero_g_limits_v
    assert limits.offset_mg_per_c == pytest.approx(1e3 * part.zero_g_offset_g_per_k)
    assert limits.sensitivity_percent_per_c == pytest.approx(100 * part.scale_factor_per_k)


def test_another_part_at_the_address_is_refused() -> None:
    rig = AnalogueRig()
    rig.chip.registers[3] = 0x4B00  # a TMP102
    with pytest.raises(IdentityError, match="thresholds read 8000 4B00, an ADS1115 has 8000 7FFF"):
        rig.open()


@pytest.mark.slow
@pytest.mark.parametrize("number", [errno.EREMOTEIO, errno.EIO])
def test_a_transfer_that_fails_twice_costs_no_sample(number: int) -> None:
    rig = AnalogueRig(signal=swinging)
    rig.open()
    rig.read_s(2)
    rig.chip.fail(number, 2)
    rig.read_s(2)
    assert sum(rig.device.faults.values()) == 2
    assert sum(block.lost for block in rig.blocks) == 0
    assert np.abs(rig.force_g - [swinging(time_s) for time_s in rig.time_s]).max() < 0.012


@pytest.mark.slow
@pytest.mark.parametrize("number", [errno.EREMOTEIO, errno.ETIMEDOUT, errno.EIO])
def test_a_dead_bus_is_raised_within_two_seconds(number: int) -> None:
    rig = AnalogueRig()
    rig.open()
    rig.read_s(1)
    rig.chip.fail(number, 1000)
    start_s = rig.clock.elapsed_s
    with pytest.raises(TransferError, match="I2C bus 1 address 0x48"):
        rig.read_s(5)
    assert rig.clock.elapsed_s - start_s < 2


def test_a_brown_out_within_a_conversion_is_detected() -> None:
    rig = AnalogueRig()
    rig.chip.brown_out_at_s = 1.0
    rig.open()
    with pytest.raises(ConfigurationReadBackError, match=r"CONFIG \(0x01\) reads 0x8583.*lost its configuration"):
        rig.read_s(5)
    assert rig.device.faults["configuration_lost"] == 1
    assert np.abs(rig.force_g - [0, 0, 1]).max() < 1e-3


def test_a_brown_out_between_conversions_changes_nothing() -> None:
    rig = AnalogueRig()
    rig.open()
    rig.read_s(1)
    rig.chip.brown_out()
    rig.read_s(1)
    assert np.abs(rig.force_g - [0, 0, 1]).max() < 1e-3


@pytest.mark.slow
def test_one_disturbed_reading_of_the_configuration_is_tolerated() -> None:
    for bit in range(15):
        rig = AnalogueRig()
        rig.open()
        rig.read_s(0.5)
        rig.chip.disturbed[1] = [1 << bit]
        rig.read_s(0.5)
        assert rig.chip.disturbed[1] == []
        assert np.abs(rig.force_g - [0, 0, 1]).max() < 1e-3


def test_a_bus_that_reads_ones_gives_no_data() -> None:
    rig = AnalogueRig()
    rig.open()
    rig.read_s(1)
    samples = len(rig.force_g)
    rig.chip.stuck_high = True
    with pytest.raises(ConfigurationReadBackError, match="reads 0xffff"):
        rig.read_s(5)
    assert len(rig.force_g) == samples


def test_a_conversion_that_does_not_end_is_reported() -> None:
    rig = AnalogueRig()
    rig.open()
    rig.chip.stuck = True
    with pytest.raises(TransferError, match="a conversion does not end; power-cycle the converter"):
        rig.read_s(1)


def test_a_part_that_holds_sda_low_is_usable_once_it_lets_go() -> None:
    rig = AnalogueRig()
    rig.open()
    rig.read_s(1)
    rig.chip.sda_low = True
    with pytest.raises(TransferError, match="a part holds the bus"):
        rig.read_s(5)
    rig.chip.clear_bus()
    start_s = rig.clock.elapsed_s
    rig.open()
    while not (block := rig.device.read()):
        pass
    assert len(block)
    assert rig.clock.elapsed_s - start_s < 1


def test_interpolation_is_exact_on_lines() -> None:
    times_ns = np.array([[0, 3, 6], [10, 14, 16]]) * 1_000_000 + START_NS
    volts = np.array([[1.0, 2.0, 3.0], [2.0, 3.1, 1.0]])
    instants_ns = np.array([6, 9]) * 1_000_000 + START_NS
    found = interpolate_channels(times_ns, volts, instants_ns)
    assert found == pytest.approx(np.array([[1.6, 2.3, 3.0], [1.9, 2.6, 2.4]]))
