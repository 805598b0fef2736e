"""Circular swings near the load: several motions explain a part of the readings, and all of it only one."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.swing.estimate import SwingEstimate
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.values import present

LENGTH_M, GRAVITY_M_S2, NOISE_G = 15.0, 9.80665, 9e-4
Array = NDArray[np.float64]


def circle(angle_deg: float, rho: float, seconds: float, rate_hz: float = 10.0, damping_1_s: float = 6e-4) -> Array:
    """Readings on a conical pendulum, in closed form: shape (n, 3), in g.

    In the frame of a housing that does not turn about the rope, gravity turns by cos(angle) times the angular velocity.
    """
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    angle = math.radians(angle_deg) * np.exp(-damping_1_s * time_s)
    rate_1_s = np.sqrt(GRAVITY_M_S2 / (LENGTH_M * np.cos(angle)))
    turned = np.cumsum(rate_1_s * np.cos(angle)) / rate_hz
    across = -(1 - rho) * np.sin(angle)
    along = np.cos(angle) + rho * LENGTH_M / GRAVITY_M_S2 * (rate_1_s * np.sin(angle)) ** 2
    return np.column_stack([across * np.cos(turned), across * np.sin(turned), along])


def measured(force_g: Array, rho: float, rate_hz: float = 10.0, **rig: Any) -> SwingEstimate:
    noise_g = np.random.default_rng(1).normal(0, NOISE_G, force_g.shape)
    stated: dict[str, Any] = {
        "zero_g_offset_u_g": (0.02,) * 3,
        "scale_u": (0.01,) * 3,
        "cross_axis_u": 0.01,
        "mount_u_rad": None,
    }
    housing = MountedHousing(
        length_m=LENGTH_M, position_m=rho * LENGTH_M, position_u_m=0.155, beside_u_m=0.02, **(stated | rig)
    )
    return estimate_swing(np.arange(len(force_g)) / rate_hz, force_g + noise_g, rig=housing, noise_g=NOISE_G)


def covers(estimate: SwingEstimate, angle_deg: float) -> bool:
    low_rad, high_rad = present(estimate.coverage95_rad)
    return low_rad <= math.radians(angle_deg) <= high_rad


@pytest.mark.parametrize("norm_error", [-0.03, 0.0, 0.02, 0.035])
@pytest.mark.parametrize(("angle_deg", "rho", "seconds"), [(2.0, 0.9, 60.0), (5.5, 0.95, 60.0), (3.5, 0.9, 25.0)])
def test_a_wrong_scale_is_not_taken_for_a_wider_circle(
    angle_deg: float, rho: float, seconds: float, norm_error: float
) -> None:
    estimate = measured((1 + norm_error) * circle(angle_deg, rho, seconds), rho)

    assert covers(estimate, angle_deg)


def test_an_interval_holds_every_circle_that_explains_the_readings() -> None:
    """For half a minute a circle of 20 degrees seen 0.2 m below the load reads as one of 5.5 degrees seen 0.75 m above it."""
    estimate = measured(1.02 * circle(5.5, 0.95, 25.0), 0.95)

    assert covers(estimate, 5.5)
    assert covers(estimate, 15.0)
    assert present(estimate.u_rad) > math.radians(3)
    assert present(estimate.length_u_m) > 0.2


def test_a_calibrated_sensor_tells_the_circles_apart() -> None:
    known: dict[str, Any] = {"zero_g_offset_u_g": (2e-4,) * 3, "scale_u": (1e-4,) * 3, "mount_u_rad": 0.0}

    estimate = measured(circle(5.5, 0.95, 60.0), 0.95, **known)

    assert covers(estimate, 5.5)
    assert present(estimate.u_rad) < math.radians(0.5)
