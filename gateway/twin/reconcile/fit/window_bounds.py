"""Windows of about two periods, in which a large swing is fitted first."""

import numpy as np

from devices.pendulum.small_swing import period_ratio
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.data_checks import MIN_PERIODS
from gateway.twin.reconcile.data.observations import Observations

LOWEST_POINT_SEARCH_PERIODS = 0.55
"""Length of the interval, in periods, in which a lowest point is searched: there are two in each period."""


def window_bounds(rig: TwinRig, observations: Observations) -> list[int]:
    """Return the first samples of windows of about two periods.

    All but the first begin at a lowest point, where the samples determine the initial state well.
    """
    period_s = swing_period_s(rig, observations)
    count = max(1, round(observations.duration_s / (MIN_PERIODS * period_s)))
    first_samples = {0}
    for nominal_s in observations.duration_s * np.arange(1, count) / count:
        distance_s = np.abs(observations.time_s - nominal_s)
        near = np.flatnonzero(distance_s < LOWEST_POINT_SEARCH_PERIODS / 2 * period_s)
        first_samples.add(int(near[np.argmax(observations.force_g[near, 2])]))
    return sorted(first_samples)


def swing_period_s(rig: TwinRig, observations: Observations) -> float:
    """Return the nominal period at the recording's amplitude."""
    return rig.small_swing_period_s * period_ratio(observations.amplitude_rad)
