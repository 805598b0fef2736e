"""A housing at the load, which reads the swing along the rope: initial states, their rotations, and fits."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations, make_observations
from gateway.twin.reconcile.fit.fit_context import FitContext, segment_bounds
from gateway.twin.reconcile.fit.initial_conditions import rotate_about_vertical, segment_initial_conditions
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
NOISE_G = 1e-3
DAMPED: EffectValues = {"viscous_damping": {"damping_ratio": 0.005}}


def rig_at(rho: float, length_m: float = 1.0) -> TwinRig:
    return TwinRig(length_m, rho * length_m, noise_g=(NOISE_G,) * 3)


def recorded(rig: TwinRig, start: Array, effects: EffectValues | None = None) -> Observations:
    """Return 30 s at 25 Hz with noise."""
    time_s, simulator = np.arange(0, 30, 0.04), Simulator(rig, sorted(effects or {}))
    force_g = simulator.predict(simulator.values(start, effects or {}), time_s)
    noise_g = NOISE_G * np.random.default_rng(1).normal(size=force_g.shape)
    return make_observations(time_s, force_g + noise_g, None, np.full(3, NOISE_G))


def started(rig: TwinRig, amplitude_rad: float) -> Array:
    """Return an elliptical swing that starts between its turning points."""
    rate = rig.small_swing_rate_1_s
    return np.array([0.6 * amplitude_rad, 0.1, -0.7 * rate * amplitude_rad, 0.1 * rate, 0.0])


@pytest.mark.parametrize("angle_rad", [0.5, 2.0, -3.0])
def test_rotation_about_the_vertical_leaves_the_samples_of_a_large_swing_unchanged(angle_rad: float) -> None:
    simulator, time_s = Simulator(rig_at(0.6)), np.arange(0, 3, 0.05)
    start = np.array([0.9, -0.7, 1.2, 0.5, 0.3])
    rotated = rotate_about_vertical(start[None], np.array([angle_rad]), simulator.structure)[0]

    assert np.abs(rotated[:4] - start[:4]).max() > 0.3
    np.testing.assert_allclose(simulator.predict(rotated, time_s), simulator.predict(start, time_s), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.5, 1.0, 1.03])
@pytest.mark.parametrize("amplitude_rad", [0.15, 1.2])
def test_segments_that_are_fitted_one_by_one_continue_each_other(rho: float, amplitude_rad: float) -> None:
    rig = rig_at(rho)
    observations, simulator = recorded(rig, started(rig, amplitude_rad)), Simulator(rig)
    first_samples = segment_bounds(rig, {}, observations)
    starts = segment_initial_conditions(simulator, observations, np.zeros(0), first_samples)
    batch = simulator.linearise_segments(starts, np.zeros(0), observations.time_s, first_samples)

    for first, last in pairwise([*first_samples, len(observations.time_s)]):
        part = slice(first, last)
        assert (observations.residual_sigma(batch.force_g)[part] ** 2).mean() < 1.5
    gaps = batch.ends[:-1] - starts[1:]
    gaps[:, HEADING] = (gaps[:, HEADING] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(gaps).max(initial=0) < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.97, 1.0])
@pytest.mark.parametrize("amplitude_rad", [0.05, 0.3, 1.2])
def test_free_swing_at_the_load_is_one_trajectory(rho: float, amplitude_rad: float) -> None:
    rig = rig_at(rho)
    observations = recorded(rig, started(rig, amplitude_rad))

    assert FitContext(rig, {}, observations, lambda: None).fit({}).chi2 < 1.06 * observations.n_values


@pytest.mark.slow
@pytest.mark.parametrize("amplitude_rad", [0.3, 1.2])
def test_damping_shows_along_the_rope_whatever_the_sign_of_the_swing(amplitude_rad: float) -> None:
    rig = rig_at(1.0)
    for sign in (1, -1):
        observations = recorded(rig, sign * started(rig, amplitude_rad), DAMPED)
        context = FitContext(rig, {}, observations, lambda: None)
        fit = context.fit({"viscous_damping": {}})

        assert fit.chi2 < 1.06 * observations.n_values
        ratio = context.simulator(("viscous_damping",)).effects(fit.values)["viscous_damping"]["damping_ratio"]
        assert ratio == pytest.approx(0.005, rel=0.03)
