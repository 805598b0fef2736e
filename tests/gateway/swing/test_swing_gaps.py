"""Recordings with gaps, as a quota leaves them: no piece of one is too small to be judged."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.simulated.crane import Crane
from devices.simulated.schedule import Hoist
from gateway.swing.data.bins import bin_samples
from gateway.swing.estimation.robust_fit import MIN_FITTED_BINS, fit_robust, fit_robust_from
from gateway.swing.fit.harmonics import find_harmonics
from gateway.swing.fit.initial_guess import initial_motions
from gateway.swing.fit.priors import nominal_prior
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.conftest import simulate

NOISE_G, LENGTH_M = 4e-4, 9.0
RIG = MountedHousing(length_m=1.1 * LENGTH_M, above_load_m=4.5)
DURATION_S = 50.0
GAPS_S = st.lists(st.tuples(st.floats(0.0, 48.0), st.floats(0.5, 16.0)), min_size=1, max_size=5)
"""Begin and duration."""


@pytest.fixture(scope="module")
def hoisted() -> tuple[np.ndarray, np.ndarray]:
    """Times, and what a sensor reads while a swinging load is hoisted."""
    crane = Crane(
        length_m=LENGTH_M,
        position_m=4.5,
        events=[Hoist(15.0, 12.0, -3.0)],
        motion=start_motion(0.12, 0.0, 0.0, 0.02),
        damping_ratio=0.002,
    )
    time_s = np.arange(0, DURATION_S, 0.1)
    force_g = crane.specific_force_m_s2(time_s) / STANDARD_GRAVITY_M_S2
    return time_s, force_g + NOISE_G * np.random.default_rng(3).normal(size=force_g.shape)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(gaps_s=GAPS_S)
@example(gaps_s=[(30.6, 1.2), (12.9, 13.2), (2.0, 14.7)])  # no bin in a core
@example(gaps_s=[(17.6, 10.8), (9.6, 7.9), (4.3, 15.8)])  # no bin in the window of a hoist
def test_gaps_beside_a_hoist_leave_an_estimate_or_a_reason(
    hoisted: tuple[np.ndarray, np.ndarray], gaps_s: list[tuple[float, float]]
) -> None:
    time_s, force_g = hoisted
    kept = np.all([(time_s < begin_s) | (time_s >= begin_s + lasts_s) for begin_s, lasts_s in gaps_s], axis=0)

    found = estimate_swing(time_s[kept], force_g[kept], rig=RIG, noise_g=NOISE_G)

    if found.coverage95_rad is None:
        assert found.reasons
    else:
        low_rad, high_rad = found.coverage95_rad
        assert 0 <= low_rad < high_rad <= np.pi


def test_a_recording_whose_first_periods_are_clipped_away_is_judged_from_the_rest() -> None:
    """Readings of z at the limit are spared; here all of them are, but the first ones, for four periods."""
    recording = simulate(rho=0.9, amplitude_deg=8.0, duration_s=90.0)
    force_g = recording.force_g.copy()
    lost = (recording.time_s > 0.02) & (recording.time_s < 25.0)
    force_g[lost, 2] = force_g[:, 2].max()

    found = estimate_swing(
        recording.time_s,
        force_g,
        rig=MountedHousing(length_m=recording.length_m, position_m=recording.position_m),
        noise_g=NOISE_G,
    )

    assert found.coverage95_rad is not None
    assert found.coverage95_rad[0] < recording.phi_max_rad < found.coverage95_rad[1]


@pytest.mark.parametrize("count", range(MIN_FITTED_BINS))
def test_few_readings_are_not_fitted(count: int) -> None:
    recording = simulate(duration_s=20.0)
    noise_g = np.full(3, NOISE_G)
    bins = bin_samples(recording.time_s, recording.force_g, 0.2)
    (guess, *_) = initial_motions(find_harmonics(bins, noise_g, RIG), RIG, 0.0, 21.0)
    few = bins.select(slice(0, count))

    assert fit_robust(few, noise_g, guess, nominal_prior(RIG), 5) is None
    assert fit_robust_from(few, noise_g, [guess], nominal_prior(RIG), 5) is None
    assert fit_robust(bins, noise_g, guess, nominal_prior(RIG), 5) is not None
