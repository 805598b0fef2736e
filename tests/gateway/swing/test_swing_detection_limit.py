"""Near the detection limit: lone spikes, and swings of a housing at the load."""

import numpy as np
import pytest

from gateway.numerics.foreign_readings import lone_spikes
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.conftest import simulate
from tests.values import present

NOISE_G = 2.5e-3


@pytest.mark.parametrize("where", [0, 3, 50, 96, 99])
def test_a_lone_spike_is_found_where_it_is(where: int) -> None:
    time_s = np.arange(100) / 50
    force_g = np.stack([0.1 * np.sin(time_s), 0.1 * np.cos(time_s), 1 - 0.01 * np.sin(2 * time_s)], axis=1)
    force_g += 1e-4 * np.random.default_rng(7).normal(size=force_g.shape)
    force_g[where] += [0.0, 0.02, 0.0]

    assert np.flatnonzero(lone_spikes(force_g, np.full(3, 1e-4))).tolist() == [where]


def test_an_event_of_many_samples_is_not_a_spike() -> None:
    force_g = np.random.default_rng(8).normal(scale=1e-4, size=(400, 3))
    force_g[100:140:2] += 0.05

    assert not lone_spikes(force_g, np.full(3, 1e-4)).any()


@pytest.mark.slow
def test_a_swing_near_the_detection_limit_has_an_interval_down_to_zero() -> None:
    """At the load 1 degree is 0.2 mg along the rope, in a noise of 2.5 mg per sample."""
    recording = simulate(rho=0.999, amplitude_deg=1.0, duration_s=90, noise_g=NOISE_G, seed=2)
    rig = MountedHousing(length_m=9.2, position_m=recording.position_m)

    estimate = estimate_swing(recording.time_s, recording.force_g, rig=rig, noise_g=NOISE_G)

    assert estimate.swinging
    low, high = present(estimate.coverage95_rad)
    assert low == 0.0
    assert recording.phi_max_rad < high < 2 * recording.phi_max_rad
    assert present(estimate.u_rad) > 0.2 * present(estimate.phi_max_rad)
    assert any("not significant against noise" in reason for reason in estimate.reasons)


@pytest.mark.slow
def test_rest_in_the_same_noise_is_not_a_swing() -> None:
    time_s = np.arange(4500) / 50
    for seed in range(20):
        force_g = NOISE_G * np.random.default_rng(seed).normal(size=(4500, 3)) + [0.0, 0.0, 1.0]
        still = estimate_swing(time_s, force_g, rig=MountedHousing(length_m=9.2, position_m=9.0), noise_g=NOISE_G)
        assert still.swinging is False
        assert present(still.coverage95_rad)[1] > 0
