"""The simulated crane as a device: pace, sample times, skipping ahead, sameness."""

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.block import SampleBlock
from devices.device import Device
from devices.errors import DeviceError
from devices.simulated.accelerometer import no_errors
from devices.simulated.crane import Crane
from devices.simulated.device import SimulatedCrane
from tests.clocks import SleeplessClock

START_NS = 1_760_000_000_123_456_789
"""On no grid."""
SECOND_NS = 1_000_000_000


def simulated(clock: SleeplessClock, odr_hz: float = 125.0, block_samples: int = 5, **more: object) -> SimulatedCrane:
    arguments: dict[str, object] = {"length_m": 8.0, "position_m": 6.0, **more}
    return SimulatedCrane(odr_hz=odr_hz, block_samples=block_samples, clock=clock, **arguments)  # type: ignore[arg-type]


def read(device: Device) -> SampleBlock:
    block = device.read()
    assert block is not None
    return block


def test_device_info_describes_the_simulated_sensor() -> None:
    device: Device = simulated(SleeplessClock(START_NS), seed=4)
    info = device.open()
    assert (info.kind, info.device_id, info.unit, info.odr_hz) == ("simulated", "simulated-4", "counts", 125.0)
    assert (info.units_per_g, info.zero_g_offset_g) == (256000, 0.075)
    assert info.factory_calibration is not None
    assert info.factory_calibration["device_id"] == "simulated-4"


@pytest.mark.parametrize(
    ("odr_hz", "block_samples"), [(125.0, 5), (1000.0, 32), (1000.0, 1), (3.90625, 1), (333.0, 400)]
)
def test_blocks_come_when_their_last_sample_is_due_on_an_exact_grid(odr_hz: float, block_samples: int) -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock, odr_hz, block_samples)
    device.open()
    times: list[NDArray[np.int64]] = []
    while len(times) * block_samples < 3 * odr_hz:
        block = device.read()
        if block is not None:
            assert len(block) == block_samples
            assert block.raw.shape == (block_samples, 3)
            assert (block.lost, block.invalid) == (0, 0)
            assert abs(clock.ns - block.time_ns[-1]) <= 1
            times.append(block.time_ns)
    time_ns = np.concatenate(times)
    assert time_ns.tolist() == [START_NS + round(i * 1e9 / odr_hz) for i in range(len(time_ns))]


def test_a_read_waits_half_a_second_at_most() -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock, odr_hz=10.0, block_samples=12)  # due 1.1 s after open
    device.open()
    assert device.read() is None
    assert clock.ns == START_NS + SECOND_NS // 2
    assert device.read() is None
    assert len(read(device)) == 12
    assert clock.ns == START_NS + 1_100_000_000


def test_a_slow_reader_gets_every_sample_while_less_than_a_second_behind() -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock)
    device.open()
    first = read(device)
    clock.ns += 900_000_000
    blocks = [read(device) for _ in range(30)]
    time_ns = np.concatenate([first.time_ns, *(block.time_ns for block in blocks)])
    assert np.diff(time_ns).tolist() == [8_000_000] * (len(time_ns) - 1)
    assert dict(device.faults) == {}


def test_a_first_read_that_comes_late_begins_then_and_has_lost_nothing() -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock)
    device.open()
    clock.ns += 3 * SECOND_NS
    first = read(device)
    assert (first.lost, dict(device.faults)) == (0, {})
    assert 0 <= clock.ns - first.time_ns[-1] < 8_000_000


@pytest.mark.parametrize("away_s", [1.3, 20.0, 7200.0])
def test_after_a_suspension_it_skips_to_now_and_counts_the_loss(away_s: float) -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock)
    device.open()
    before = [read(device) for _ in range(10)][-1]
    clock.ns += round(away_s * 1e9)
    after = read(device)
    assert after.time_ns[0] - before.time_ns[-1] == (after.lost + 1) * 8_000_000
    assert 0 <= clock.ns - after.time_ns[-1] < 8_000_000
    assert dict(device.faults) == {"overrun": 1}
    following = read(device)
    assert following.lost == 0
    assert following.time_ns[0] - after.time_ns[-1] == 8_000_000


@pytest.mark.slow
@pytest.mark.parametrize(("away_s", "crane_now_s"), [(20.0, 20.032), (7200.0, 30.232)])
def test_the_crane_advances_for_half_a_minute_of_an_absence(away_s: float, crane_now_s: float) -> None:
    """Half a minute from the newest reading that was made, not from the newest that was read: a quarter second ahead."""
    clock = SleeplessClock(START_NS)
    device = simulated(clock, errors=no_errors())
    device.open()
    read(device)
    clock.ns += round(away_s * 1e9)
    block = read(device)
    unbroken = simulated(SleeplessClock(START_NS)).crane
    seconds = (block.time_ns - clock.ns) / 1e9 + crane_now_s
    expected_g = unbroken.specific_force_m_s2(seconds) / unbroken.gravity_m_s2
    assert block.raw / 256000 == pytest.approx(expected_g, abs=6 * device.part.noise_g)
    assert device.truth(block.time_ns).rope_angle_rad == pytest.approx(unbroken.truth(seconds).rope_angle_rad)


@pytest.mark.slow
def test_truth_belongs_to_the_readings() -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock, errors=no_errors(), position_m=0.0)  # at the pivot the reading is the vertical itself
    device.open()
    blocks = [read(device) for _ in range(900)][-400:]  # the first hasty move is in the last 16 s
    raw_g = np.concatenate([block.raw for block in blocks]) / 256000
    truth = device.truth(np.concatenate([block.time_ns for block in blocks]))
    drives = truth.trolley | truth.gust
    assert raw_g[~drives] == pytest.approx(truth.up_in_housing[~drives], abs=6 * device.part.noise_g)
    assert np.ptp(truth.rope_angle_rad) > np.radians(5)


def test_site_gravity_is_one_g() -> None:
    crane = Crane(length_m=8.0, position_m=6.0, gravity_m_s2=9.78)
    device = simulated(SleeplessClock(START_NS), crane=crane, errors=no_errors())
    device.open()
    assert read(device).raw.mean(axis=0) / 256000 == pytest.approx([0, 0, 1], abs=4 * device.part.noise_g / np.sqrt(5))


def test_the_same_seed_gives_the_same_readings_for_any_blocks() -> None:
    readings = []
    for later_ns, block_samples in ((0, 5), (977_777_777, 20)):
        clock = SleeplessClock(START_NS)
        clock.ns += later_ns
        device = simulated(clock, block_samples=block_samples, seed=9)
        device.open()
        readings.append(np.concatenate([read(device).raw for _ in range(200 // block_samples)]))
    assert np.array_equal(readings[0], readings[1])
    other = simulated(SleeplessClock(START_NS), seed=10)
    other.open()
    assert not np.array_equal(read(other).raw, readings[0][:5])


def test_factory_calibration_recovers_the_true_tilt() -> None:
    leaning = Crane(length_m=8.0, position_m=6.0, gravity_m_s2=9.80665)
    device = simulated(SleeplessClock(START_NS), crane=leaning, seed=3)
    record = device.open().factory_calibration
    assert record is not None
    raw = np.concatenate([read(device).raw for _ in range(200)])
    corrected_g = (raw.mean(axis=0) - record["offset"]) @ np.array(record["correction_matrix"]).T
    assert corrected_g == pytest.approx([0, 0, 1], abs=1.2e-3)
    assert np.abs(raw.mean(axis=0) / 256000 - [0, 0, 1]).max() > 3e-3  # uncalibrated it is far off


@pytest.mark.parametrize("away_s", [0.0, 5.0, 7200.0])
def test_reopening_starts_a_new_grid(away_s: float) -> None:
    clock = SleeplessClock(START_NS)
    device = simulated(clock)
    device.open()
    read(device)
    device.close()
    device.close()
    with pytest.raises(DeviceError, match="read before open"):
        device.read()
    clock.ns += round(away_s * 1e9)
    device.open()
    block = read(device)
    assert block.time_ns[0] == START_NS + 32_000_000 + round(away_s * 1e9)
    assert block.lost == 0
    assert dict(device.faults) == {}
    crane_s = (block.time_ns - block.time_ns[0]) / 1e9 + (away_s + 0.032 if away_s < 30 else 30 + 0.232)
    expected = simulated(SleeplessClock(START_NS)).crane.truth(crane_s).rope_angle_rad
    assert device.truth(block.time_ns).rope_angle_rad == pytest.approx(expected, rel=1e-6)


def test_the_temperature_is_near_that_of_the_calibration() -> None:
    device = simulated(SleeplessClock(START_NS))
    record = device.open().factory_calibration
    assert record is not None
    temperature_c = read(device).temperature_c
    assert temperature_c is not None
    assert abs(temperature_c - record["temperature_c"]["mean"]) <= 2.0


@pytest.mark.parametrize("wrong", [{"odr_hz": 0.0}, {"block_samples": 0}, {"range_g": -2.0}])
def test_impossible_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must all be positive"):
        simulated(SleeplessClock(START_NS), **wrong)  # type: ignore[arg-type]
