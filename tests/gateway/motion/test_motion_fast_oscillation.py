"""Fast oscillations: a planted line is found with its frequency and size, and nothing is found where there is none."""

import numpy as np
import pytest

from devices.pendulum.double_pendulum import modes
from devices.simulated.schedule import TrolleyMove
from gateway.motion.fast_oscillation import FastOscillation, FastOscillationDetector
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing
from tests.blind.mechanics import Hook
from tests.gateway.motion.conftest import GRAVITY_M_S2, RATE_HZ, Recording, follow, swing
from tests.values import present
from tests.working_crane.commands import commands
from tests.working_crane.crane import Crane
from tests.working_crane.engine import simulate, step_s
from tests.working_crane.events import Drive

BIN_S = 0.1
SWING_RATE_1_S = 1.0


def detect(force_g: Array) -> list[FastOscillation | None]:
    """What was found at each check."""
    detector = FastOscillationDetector(BIN_S, SWING_RATE_1_S)
    return [detector.found for reading in force_g if detector.add(reading)]


@pytest.mark.slow
@pytest.mark.parametrize("frequency_hz", [0.8, 1.37, 2.9, 4.1])
@pytest.mark.parametrize("seed", range(5))
def test_planted_line_is_found_with_frequency_and_amplitude(frequency_hz: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    amplitude_g, azimuth, phase = rng.uniform(1e-3, 1e-2), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    time_s: Array = BIN_S * np.arange(300, dtype=np.float64)
    along = amplitude_g * np.cos(2 * np.pi * frequency_hz * time_s + phase)
    slow = 0.03 * np.cos(SWING_RATE_1_S * time_s)
    force_g = 2e-4 * rng.normal(size=(300, 3))
    force_g[:, 0] += along * np.cos(azimuth) + slow
    force_g[:, 1] += along * np.sin(azimuth)

    found = present(detect(force_g)[-1])

    assert found.rate_1_s == pytest.approx(2 * np.pi * frequency_hz, rel=0.01)
    assert found.amplitude_g == pytest.approx(amplitude_g / np.sqrt(2), rel=0.05)


@pytest.mark.parametrize("frequency_hz", [0.7, 1.37, 2.9])
def test_line_that_begins_at_once_is_found_within_five_seconds(frequency_hz: float) -> None:
    """Its amplitude is not that of the quiet time before; its frequency is known to what the stated uncertainty says."""
    begin, within = 200, 50
    force_g = 2e-4 * np.random.default_rng(3).normal(size=(begin + within, 3))
    force_g[begin:, 0] += 0.05 * np.cos(2 * np.pi * frequency_hz * BIN_S * np.arange(within))

    found = present(detect(force_g)[-1])

    assert abs(found.rate_1_s - 2 * np.pi * frequency_hz) < 2 * found.rate_u_1_s
    assert 0.02 < found.amplitude_g < 0.05


@pytest.mark.slow
def test_no_line_is_found_in_white_noise() -> None:
    for seed in range(200):
        assert not any(detect(1e-3 * np.random.default_rng(seed).normal(size=(300, 3))))


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude_deg", "rho"), [(5.0, 0.5), (10.0, 0.1), (20.0, 0.5)])
def test_nothing_is_named_in_a_free_swing(amplitude_deg: float, rho: float) -> None:
    """Wide swings have harmonics. The noise is that of a thousand samples of 1 mg in each second."""
    recording = swing(amplitude_deg=amplitude_deg, rho=rho, noise_g=2e-4)

    assert not any(e.fast_oscillation for e in follow(recording))


@pytest.mark.slow
@pytest.mark.parametrize("ramp_s", [2.0, 4.0])
def test_nothing_is_named_in_a_drive(ramp_s: float) -> None:
    drives = [TrolleyMove(6.0, 8.0, ramp_s, 0.8, 0.3), TrolleyMove(20.0, 8.0, ramp_s, -0.8, 2.0)]
    recording = swing(amplitude_deg=1.0, length_m=8.0, events=drives)

    assert not any(e.fast_oscillation for e in follow(recording))


def test_line_is_forgotten_when_it_has_ended() -> None:
    rng = np.random.default_rng(1)
    force_g = 1e-4 * rng.normal(size=(600, 3))
    force_g[:200, 0] += 5e-3 * np.cos(7.0 * BIN_S * np.arange(200))

    found = detect(force_g)

    assert found[10] is not None
    assert found[-1] is None


@pytest.mark.slow
@pytest.mark.parametrize(("rigging_m", "hook_mass_ratio"), [(1.5, 0.08), (3.0, 0.12)])
def test_load_that_swings_under_its_hook_is_found_at_its_second_mode(rigging_m: float, hook_mass_ratio: float) -> None:
    length_m, above_m, noise_g = 12.0, 6.0, 3e-4
    crane = Crane(length_m, above_m, 0.003, hook=Hook(rigging_m, hook_mass_ratio))
    half_s = step_s(crane) / 2
    time_s: Array = half_s * np.arange(round(45 / half_s), dtype=np.float64)
    given = commands(crane, (Drive(2.0, 1.5, 40.0, 0.5, 0.4),), (0.0, 0.0), time_s)
    motion = simulate(crane, given, (0.01, 0.0), (0.01, 0.02))
    every = round(1 / (RATE_HZ * step_s(crane)))
    force_g = motion.force_m_s2[::every] / GRAVITY_M_S2
    force_g += noise_g * np.random.default_rng(1).normal(size=force_g.shape)
    angle_rad = np.arccos(-motion.direction[::every, 2])
    rig = MountedHousing(length_m=length_m, above_load_m=above_m, length_u_rel=0.05, position_u_m=0.02)
    recording = Recording(np.arange(len(force_g)) / RATE_HZ, force_g, angle_rad, rig)

    estimates = list(follow(recording))

    _, second = modes(length_m - rigging_m, rigging_m, hook_mass_ratio, GRAVITY_M_S2)
    named = [e.fast_oscillation for e in estimates if e.time_s > 30 and e.fast_oscillation is not None]
    assert len(named) > 0.8 * sum(e.time_s > 30 for e in estimates)
    frequencies_hz = [one.frequency_hz for one in named]
    assert np.median(frequencies_hz) == pytest.approx(float(second.rate) / (2 * np.pi), rel=0.01)
