"""What is seen in the readings themselves, and recordings that say nothing."""

import numpy as np
import pytest

from gateway.twin.reconcile.data.artefact_detectors import detect_quantisation_step, detect_saturation, quantised_mean
from gateway.twin.reconcile.data.data_checks import find_fault
from gateway.twin.reconcile.data.observations import detect_spikes

NOISE_G = np.full(3, 5e-4)


def test_the_step_of_the_readings_is_found_to_a_millionth(record):
    force_g = record({}).force_g
    step_g = 0.0041237
    written = np.round(step_g * np.round(force_g / step_g), 7)

    assert detect_quantisation_step(written, NOISE_G) == pytest.approx(step_g, rel=1e-6)
    assert detect_quantisation_step(np.round(force_g, 7), NOISE_G) is None


def test_a_limit_is_found_and_the_top_of_noise_is_none(record):
    force_g = record({}).force_g

    assert detect_saturation(np.minimum(force_g, 1.001)) == pytest.approx(1.001)
    assert detect_saturation(force_g) is None


def test_the_mean_of_steps_is_the_mean_of_many_noisy_readings():
    rng = np.random.default_rng(1)
    force_g = np.linspace(-0.013, 0.013, 30).reshape(10, 3)
    drawn = np.mean(
        [0.005 * np.round((force_g + 1e-3 * rng.normal(size=force_g.shape)) / 0.005) for _ in range(4000)], axis=0
    )

    np.testing.assert_allclose(quantised_mean(force_g, 0.005, np.full(3, 1e-3)), drawn, atol=2e-4)


def test_lone_samples_are_left_out_and_a_swing_is_not(record):
    force_g = record({}).force_g.copy()
    force_g[500, 2] += 0.05
    found = detect_spikes(force_g)

    assert found[500]
    assert found[0]
    assert found.sum() <= 4  # a neighbour of the spike may go with it


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t, f: (t[:100], f[:100]), "too short"),
        (lambda t, f: (t[:220], f[:220]), "too short"),
        (lambda t, f: (t, f * 9.80665), "wrong units"),
        (lambda t, f: (t, 0 * f + [0, 0, 1] + 5e-4 * np.random.default_rng(1).normal(size=f.shape)), "static"),
        (lambda t, f: (t, f + np.random.default_rng(1).normal(size=f.shape)), "too noisy"),
        (lambda t, f: (t, f * [1, 1, 0] + [0, 0, 1.0]), "clipped or stuck"),
        (lambda t, f: (t / 1.42, f), "the rig is wrong"),
    ],
)
def test_a_recording_that_says_nothing_is_refused_with_the_reason(record, rig, change, said):
    observations = record({})
    time_s, force_g = change(observations.time_s, observations.force_g)

    assert said in (find_fault(time_s, force_g, rig) or "")


def test_a_rope_that_goes_slack_is_no_pendulum(record, rig):
    observations = record({})
    force_g = observations.force_g.copy()
    force_g[400:420] *= 0.1  # a second; the swing takes 5.7 s

    assert "in free fall" in (find_fault(observations.time_s, force_g, rig) or "")
    force_g[400:413] = observations.force_g[400:413]
    assert find_fault(observations.time_s, force_g, rig) is None


def test_a_good_recording_is_not_refused(record, rig):
    observations = record({})

    assert find_fault(observations.time_s, observations.force_g, rig) is None
