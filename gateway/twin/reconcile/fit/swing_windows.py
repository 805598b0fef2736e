"""Windows of about two periods, in which a large swing is fitted first, and their initial states from two samples each.

Angles above 90 degrees are included.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.data_checks import MIN_PERIODS
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.simulator.state import ROPE_RATES, ROPE_TILTS

LOWEST_POINT_SEARCH_PERIODS = 0.55
"""Length of the interval, in periods, in which a lowest point is searched: there are two in each period."""
Array = NDArray[np.float64]
RATE_INTERVAL_PERIODS = 0.02
"""Interval over which the difference of two readings gives a rate, in periods."""
MIN_COSINE = 0.3
"""Least |cosine| of the rope's angle by which the rate of the azimuth is divided: nearer to the horizontal it shows little."""


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


def initial_state_from_samples(
    rig: TwinRig, observations: Observations, first_samples: Sequence[int], n_states: int
) -> Array:
    """Return the tilts and rates that the readings show at the first samples of windows, shape (windows, states).

    The heading is 0: the housing's x axis is the one across the rope that is nearest to the world's.
    """
    initial_states = np.zeros((len(first_samples), n_states))
    ahead = max(1, int(np.searchsorted(observations.time_s, RATE_INTERVAL_PERIODS * swing_period_s(rig, observations))))
    at = np.minimum(np.array(first_samples), len(observations.time_s) - 1 - ahead)
    upward, upward_ahead = (_upward(rig, observations, each) for each in (at, at + ahead))
    elapsed_s = observations.time_s[at + ahead] - observations.time_s[at]
    rates = _rates_across(upward, (upward_ahead - upward) / elapsed_s[:, None])
    initial_states[:, ROPE_TILTS], initial_states[:, ROPE_RATES] = _tilts_and_rates(upward, rates)
    return initial_states


def _upward(rig: TwinRig, observations: Observations, at: NDArray[np.int_]) -> Array:
    """Return the vertical in the housing's axes at some samples (k,), which a housing at the pivot would read, shape (k, 3).

    A free swing reads (1 - p/L) sin(angle) across the rope, in g, and along it cos(angle) and the centripetal acceleration, which
    by the energy of a swing from amplitude A is 2 (p/L) (cos(angle) - cos A). The angle is that of both, so that it may exceed 90
    degrees, and at most A: where the stated length is wrong, the reading across the rope alone may exceed any sine.
    """
    share = rig.position_m / rig.length_m
    across = observations.force_g[at, :2] / (1 - share)
    sine = np.hypot(*across.T)
    if observations.has_large_amplitude:
        amplitude_rad = observations.amplitude_rad
        cosine = (observations.force_g[at, 2] + 2 * share * np.cos(amplitude_rad)) / (1 + 2 * share)
        angle_rad = np.minimum(np.arctan2(sine, cosine), amplitude_rad)
    else:
        angle_rad = np.arcsin(np.minimum(sine, 1.0))
    direction = across / np.maximum(sine, 1e-12)[:, None]
    return np.column_stack([np.sin(angle_rad)[:, None] * direction, np.cos(angle_rad)])


def _rates_across(upward: Array, rate_1_s: Array) -> Array:
    """Return the rate of the rope's direction along the housing's x and y axes, shape (k, 2), for a housing that does not spin.

    With u the vertical across the rope and c along it, u' = c r and c' = -u·r, so that c u' - u c' is r in the swing's plane.
    """
    across, cosine = upward[:, :2], upward[:, 2:]
    sine = np.linalg.norm(across, axis=1, keepdims=True)
    direction = np.where(sine > MIN_COSINE, across / np.maximum(sine, 1e-12), 0.0)
    along = ((cosine * rate_1_s[:, :2] - across * rate_1_s[:, 2:]) * direction).sum(axis=1, keepdims=True)
    beside = rate_1_s[:, :2] - (rate_1_s[:, :2] * direction).sum(axis=1, keepdims=True) * direction
    divisor = np.where(np.abs(cosine) > MIN_COSINE, cosine, np.where(cosine < 0, -MIN_COSINE, MIN_COSINE))
    rates: Array = along * direction + beside / divisor
    return rates


def _tilts_and_rates(upward: Array, rates: Array) -> tuple[Array, Array]:
    """Return the tilts toward the world's x and y, and their rates, shape (k, 2) each, at heading 0.

    The vertical is (n_x c/s, n_y/s, c) there, with the rope's direction n, c = -n_z and s² = 1 - n_x².
    """
    across_x, across_y, cosine = upward.T
    side = np.where(cosine < 0, -1.0, 1.0)
    root = np.maximum(np.sqrt(1 - np.minimum(across_y**2, 1.0)), 1e-9)
    n = np.column_stack([side * across_x / root, across_y * np.abs(cosine) / root, -cosine])
    tilt_x, tilt_y = np.arctan2(n[:, 0], -n[:, 2]), np.arcsin(np.clip(n[:, 1], -1.0, 1.0))
    length = np.maximum(np.sqrt(1 - np.minimum(n[:, 0] ** 2, 1.0)), 1e-9)
    x_axis = np.column_stack([length, -n[:, 0] * n[:, 1] / length, -n[:, 0] * n[:, 2] / length])
    velocity = rates[:, :1] * x_axis + rates[:, 1:] * np.cross(x_axis, n)
    sin_x, cos_x, sin_y, cos_y = np.sin(tilt_x), np.cos(tilt_x), np.sin(tilt_y), np.cos(tilt_y)
    rate_x = (velocity[:, 0] * cos_x + velocity[:, 2] * sin_x) / np.maximum(cos_y, 1e-9)
    rate_y = -velocity[:, 0] * sin_x * sin_y + velocity[:, 1] * cos_y + velocity[:, 2] * cos_x * sin_y
    return np.column_stack([tilt_x, tilt_y]), np.column_stack([rate_x, rate_y])
