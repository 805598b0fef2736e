"""The division of the data into fit, selection and test."""

import numpy as np
import pytest

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.recordings import find_lack_of_test, split_recordings
from gateway.twin.reconcile.search.changepoints import scan_for_changepoints


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
