"""The division of the data into fit, selection and test, and the means of a long recording's samples."""

import numpy as np
import pytest

from gateway.twin.reconcile.data.observations import (
    Observations,
    Recordings,
    find_lack_of_test,
    make_observations,
    samples_per_mean,
    split_recordings,
    take_means,
)
from gateway.twin.reconcile.search.changepoints import scan_for_changepoints

RATE_HZ, NOISE_G, PERIOD_S = 100.0, 1e-3, 6.0


def observations(duration_s: float) -> Observations:
    time_s = np.arange(0.0, duration_s, 0.01)
    return Observations(time_s, np.ones((len(time_s), 3)), None, np.full(3, 1e-3), np.ones(len(time_s), dtype=bool))


@pytest.mark.parametrize(("period_s", "block_s"), [(7.5, 4.0), (1.6, 1.6)])
def test_a_block_is_four_seconds_or_one_swing_of_a_short_pendulum(period_s: float, block_s: float) -> None:
    recordings = split_recordings(observations(60.0), observations(30.0), period_s)
    test_s = recordings.test.time_s[recordings.test.used]
    assert test_s[0] == pytest.approx(2 * block_s, abs=0.011)
    assert test_s[test_s < 4 * block_s][-1] == pytest.approx(3 * block_s, abs=0.011)


def test_ten_seconds_of_a_short_pendulum_can_be_tested() -> None:
    assert find_lack_of_test(split_recordings(observations(10.3), None, 1.6)) is None
    fault = find_lack_of_test(split_recordings(observations(10.3), None, 7.5))
    assert fault is not None
    assert "more than 8 s are needed" in fault


def test_a_recording_that_is_all_margin_has_no_window_for_an_event() -> None:
    log = observations(7.0)
    residual, jacobian = np.zeros((len(log.time_s), 3)), np.ones((len(log.time_s), 3, 2))
    assert scan_for_changepoints(log.time_s, residual, jacobian, log.used) == ()


def _true_g(time_s: np.ndarray, second_mode_hz: float = 0.0) -> np.ndarray:
    swing = 2 * np.pi * time_s / PERIOD_S
    x = 0.09 * np.sin(swing) + 0.01 * np.sin(2 * np.pi * second_mode_hz * time_s)
    return np.stack([x, 0.05 * np.cos(swing), np.full(len(time_s), 0.99)], axis=1)


def _recordings(duration_s: float, noise_g: float = NOISE_G, second_mode_hz: float = 0.0) -> Recordings:
    time_s = np.arange(0, duration_s, 1 / RATE_HZ)
    noise = np.random.default_rng(1).normal(size=(len(time_s), 3)) * noise_g
    force_g = _true_g(time_s, second_mode_hz) + noise
    return split_recordings(make_observations(time_s, force_g, None, np.full(3, NOISE_G)), None, PERIOD_S)


@pytest.mark.slow
@pytest.mark.parametrize(("duration_s", "count"), [(60.0, 1), (120.0, 1), (180.0, 3), (600.0, 5), (3600.0, 9)])
def test_short_recordings_stay_and_long_ones_never_get_slower_than_ten_hertz(duration_s: float, count: int) -> None:
    recordings = _recordings(duration_s)
    assert samples_per_mean(recordings) == count
    assert (take_means(recordings, count) is recordings) == (count == 1)


def test_the_noise_that_is_stated_is_that_of_the_means() -> None:
    log = take_means(_recordings(600.0), 7).log
    assert log.noise_g == pytest.approx(np.full(3, NOISE_G / np.sqrt(7)), rel=0.1)
    assert log.reduced_chi2(_true_g(log.time_s)) == pytest.approx(1.0, abs=3 * np.sqrt(2 / log.n_values))


@pytest.mark.parametrize(("second_mode_hz", "most_g"), [(0.0, 1e-7), (1.0, 2e-5), (2.0, 2.5e-4)])
def test_a_swing_and_a_second_mode_of_10_mg_keep_their_size(second_mode_hz: float, most_g: float) -> None:
    log = take_means(_recordings(600.0, noise_g=0.0, second_mode_hz=second_mode_hz), 7).log
    assert np.abs(log.force_g - _true_g(log.time_s, second_mode_hz))[log.used].max() < most_g


def test_what_does_not_count_enters_no_mean() -> None:
    recordings = _recordings(600.0, noise_g=0.0)
    wrong = recordings.log.force_g.copy()
    spikes, work = np.arange(50, 39_000, 40), slice(10_000, 12_000)
    wrong[spikes] += 1.0
    wrong[work] += 5.0
    used = np.ones(len(wrong), dtype=bool)
    used[spikes], used[work] = False, False
    log = recordings.log
    spoilt = Observations(log.time_s, wrong, None, log.noise_g, used)
    found = take_means(Recordings(spoilt, spoilt, spoilt, last_third=True, block_s=4.0), 7).log
    near = (found.time_s > 99.8) & (found.time_s < 120.2)
    assert not found.used[(found.time_s > 100.0) & (found.time_s < 120.0)].any()
    assert found.used[~near][2:-1].all()
    assert np.abs(found.force_g - _true_g(found.time_s))[found.used].max() < 1e-4
