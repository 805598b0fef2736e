"""The low-pass inside a sensor: a planted single pole is corrected, and its uncertainty is part of the result."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.motion.motion_monitor import MotionMonitor
from gateway.swing.estimate import SwingEstimate
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.conftest import Recording, simulate
from tests.values import present

BANDWIDTH_HZ = 1.0
RATE_HZ = 50.0


def one_pole(force_g: NDArray[np.float64], bandwidth_hz: float = BANDWIDTH_HZ) -> NDArray[np.float64]:
    share = 1 - np.exp(-2 * np.pi * bandwidth_hz / RATE_HZ)
    out, state = np.empty_like(force_g), force_g[0]
    for i, now in enumerate(force_g):
        state = state + share * (now - state)
        out[i] = state
    return out


def estimated(
    recording: Recording, force_g: NDArray[np.float64], bandwidth_hz: float | None, position_m: float | None = None
) -> SwingEstimate:
    rig = MountedHousing(
        length_m=recording.length_m,
        position_m=recording.position_m if position_m is None else position_m,
        bandwidth_hz=bandwidth_hz,
    )
    return estimate_swing(recording.time_s, force_g, rig=rig)


@pytest.fixture(scope="module", params=[0.05, 0.6])
def filtered(request: pytest.FixtureRequest) -> tuple[Recording, NDArray[np.float64]]:
    recording = simulate(rho=request.param, length_m=6.0, noise_g=0.0, duration_s=40)
    noise_g = 1e-4 * np.random.default_rng(2).normal(size=recording.force_g.shape)
    return recording, one_pole(recording.force_g) + noise_g


@pytest.mark.slow
def test_attenuation_is_corrected_and_part_of_the_uncertainty(filtered: tuple[Recording, NDArray[np.float64]]) -> None:
    recording, force_g = filtered

    taken_as_it_is = estimated(recording, force_g, None)
    corrected = estimated(recording, force_g, BANDWIDTH_HZ)

    wrong, right = (abs(present(e.phi_max_rad) / recording.phi_max_rad - 1) for e in (taken_as_it_is, corrected))
    assert wrong > 0.01
    assert right < 0.4 * wrong
    low, high = present(corrected.coverage95_rad)
    assert low < recording.phi_max_rad < high


@pytest.mark.slow
def test_delay_is_corrected(filtered: tuple[Recording, NDArray[np.float64]]) -> None:
    recording, force_g = filtered

    late, right = (estimated(recording, force_g, hz) for hz in (None, BANDWIDTH_HZ))

    moved_s = np.mean([a.time_s - b.time_s for a, b in zip(late.swings[1:-1], right.swings[1:-1], strict=True)])
    assert moved_s == pytest.approx(1 / (2 * np.pi * BANDWIDTH_HZ), rel=0.15)


@pytest.mark.slow
def test_attenuation_is_part_of_the_uncertainty_live(filtered: tuple[Recording, NDArray[np.float64]]) -> None:
    recording, force_g = filtered
    rig = MountedHousing(length_m=6.0, position_m=recording.position_m, bandwidth_hz=BANDWIDTH_HZ)
    monitor = MotionMonitor(rig, mount_u_rad=1e-3, noise_g=1e-4)
    for begin in range(0, len(force_g), 5):
        time_s = recording.time_s[begin : begin + 5]
        monitor.update(time_s, force_g[begin : begin + 5])
        estimate = monitor.estimate(float(time_s[-1]))
        if time_s[-1] > 20.0:
            now_s, largest = float(time_s[-1]), present(estimate.last_peak)
            recent = (recording.time_s > now_s - present(estimate.period_s)) & (recording.time_s <= now_s)
            assert abs(largest.angle_rad - recording.angle_rad[recent].max()) < 2 * largest.u_rad


@pytest.mark.slow
def test_a_wide_band_changes_no_result_significantly() -> None:
    recording = simulate(duration_s=30)

    plain, wide = (estimated(recording, recording.force_g, hz) for hz in (None, 31.25))

    assert wide.phi_max_rad == pytest.approx(plain.phi_max_rad, abs=plain.u_rad)
    assert wide.u_rad == pytest.approx(plain.u_rad, rel=0.02)


def test_an_impossible_bandwidth_is_refused() -> None:
    with pytest.raises(ValueError, match="bandwidth"):
        MountedHousing(length_m=9.0, position_m=3.0, bandwidth_hz=0.0)
