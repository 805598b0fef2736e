"""A gateway that starts while the winch runs: the rope's length is uncertain when the gusts come."""

import math

import numpy as np
import pytest

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_period_s
from devices.simulated.demo import demo_crane
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.stats import NORMAL_975
from gateway.swing.rig import MountedHousing

LENGTH_M, ABOVE_LOAD_M = 20.0, 5.0
RATE_HZ, BLOCK = 50.0, 5
PERIOD_S = small_swing_period_s(LENGTH_M, STANDARD_GRAVITY_M_S2)


@pytest.mark.slow
def test_gusts_after_a_hoist_are_not_taken_for_a_swing_on_another_rope() -> None:
    """The demonstration's crane lowers and hoists, rests, and two gusts follow each other; the start is in the second hoist."""
    crane = demo_crane(3, LENGTH_M, LENGTH_M - ABOVE_LOAD_M)
    time_s = np.arange(0, 25 * PERIOD_S, 1 / RATE_HZ)
    parts = np.array_split(time_s, 40)
    force, angle_rad, is_hoisting = [], [], []
    for part in parts:
        truth = crane.truth(part)
        force.append(crane.specific_force_m_s2(part) / STANDARD_GRAVITY_M_S2)
        angle_rad.append(truth.rope_angle_rad)
        is_hoisting.append(truth.hoisting)
    rng = np.random.default_rng(3)
    force_g = np.concatenate(force)
    force_g += rng.normal(0, 2.5e-4, force_g.shape) + rng.normal(0, 1e-3, 3)
    true_rad, hoisting = np.concatenate(angle_rad), np.concatenate(is_hoisting)
    second = np.flatnonzero(hoisting[1:] & ~hoisting[:-1])[1] - round(2 * RATE_HZ)
    monitor = MotionMonitor(
        MountedHousing(length_m=LENGTH_M, above_load_m=ABOVE_LOAD_M, position_u_m=0.05), mount_u_rad=math.radians(0.5)
    )
    errors = []
    for begin in range(second, len(time_s) - BLOCK, BLOCK):
        block = slice(begin, begin + BLOCK)
        monitor.update(time_s[block], force_g[block])
        now_s = float(time_s[block][-1])
        estimate = monitor.estimate(now_s)
        if estimate.angle_rad is not None and estimate.u_rad is not None and now_s > time_s[second] + PERIOD_S:
            errors.append((estimate.angle_rad - true_rad[begin + BLOCK - 1], estimate.u_rad))
    error_rad, u_rad = np.array(errors).T
    assert math.degrees(np.sqrt(np.mean(error_rad**2))) < 0.4
    assert np.mean(np.abs(error_rad) < NORMAL_975 * u_rad) > 0.88
