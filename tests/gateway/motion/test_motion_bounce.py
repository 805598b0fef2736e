"""A load that bounces on its jib after a hoist, and the peak that decisions rest on."""

import math
from dataclasses import replace

import numpy as np
import pytest

from devices.simulated.schedule import Hoist
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from tests.gateway.motion.conftest import Recording, follow, holds, swing
from tests.values import present

HOIST = Hoist(start_s=15.0, duration_s=4.0, by_m=1.5)
END_S = 19.0


def bouncing(rate_1_s: float, seed: int) -> Recording:
    """A hoist at whose beginning and end the load is set bouncing with 60 mg, which dies away in ten seconds."""
    recording = swing(seed=seed, amplitude_deg=2.0, rho=0.8, length_m=20.0, events=[HOIST], duration_s=40.0)
    force_g = recording.force_g.copy()
    for begin_s in (HOIST.start_s, END_S):
        after_s = recording.time_s - begin_s
        ringing = 0.06 * np.exp(-after_s / 10.0) * np.sin(rate_1_s * after_s)
        force_g[:, 2] += np.where(after_s > 0, ringing, 0.0)
    return replace(recording, force_g=force_g)


@pytest.mark.slow
@pytest.mark.parametrize("rate_1_s", [4.5, 5.3, 6.5])
def test_the_length_stays_where_the_hoist_ended_while_the_load_bounces(rate_1_s: float) -> None:
    lengths_m, held = [], []
    for seed in range(3):
        recording = bouncing(rate_1_s, seed)
        after = [estimate for estimate in follow(recording) if estimate.time_s > END_S + 2]
        lengths_m += [present(estimate.length_m) for estimate in after]
        held += [holds(recording, estimate) for estimate in after]

    assert min(lengths_m) > 0.85 * 21.5
    assert max(lengths_m) < 1.15 * 21.5
    assert np.mean(held) > 0.9


def test_the_expected_peak_is_halfway_between_a_crane_that_goes_on_and_one_that_coasts() -> None:
    kept = PeakEstimate(angle_rad=0.10, u_rad=0.02, in_s=1.5)
    coasting = PeakEstimate(angle_rad=0.04, u_rad=0.01, in_s=1.0)
    estimate = MotionEstimate(time_s=0.0, state="driven", next_peak=kept, next_peak_if_coasting=coasting)

    expected = present(estimate.expected_peak)

    assert (expected.angle_rad, expected.u_rad) == pytest.approx((0.07, math.hypot(0.015, 0.06 / math.sqrt(12))))
    assert expected.in_s == 1.5  # of the larger one
    assert replace(estimate, next_peak=None).expected_peak == coasting
    assert replace(estimate, next_peak=None, next_peak_if_coasting=None).expected_peak is None
