"""The rope's length by the period."""

from functools import cache

import numpy as np
import pytest

from gateway.numerics.array import Array
from gateway.swing.detection.rope_length import rope_length_by_period
from tests.gateway.swing.held_pendulum import GRAVITY_M_S2, readings_g, swing
from tests.values import present

pytestmark = pytest.mark.slow


@cache
def swing_from(amplitude_deg: float) -> tuple[Array, Array]:
    """Return times in 1/w0 and the motion of one load."""
    amplitude_rad = np.radians([amplitude_deg])
    time_w0, motions = swing(amplitude_rad, 0 * amplitude_rad, np.array([0.002]), 12)
    return time_w0, motions[:, 0]


@pytest.mark.parametrize("rho", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(("amplitude_deg", "length_m"), [(6.0, 12.0), (40.0, 0.4), (80.0, 0.8), (130.0, 0.5)])
def test_the_length_is_that_of_the_period_with_the_amplitude(rho: float, amplitude_deg: float, length_m: float) -> None:
    time_w0, motion = swing_from(amplitude_deg)
    force_g, _ = readings_g(motion, rho)
    force_g = force_g + np.random.default_rng(1).normal(0.0, 0.001, force_g.shape)
    found = present(rope_length_by_period(time_w0 * np.sqrt(length_m / GRAVITY_M_S2), force_g, GRAVITY_M_S2))
    assert found.length_m == pytest.approx(length_m, rel=3 * found.u_rel)
    assert found.u_rel < 0.06


def test_a_load_at_rest_has_no_length() -> None:
    still_g = np.array([0.0, 0.0, 1.0]) + np.random.default_rng(1).normal(0.0, 0.001, (2000, 3))
    assert rope_length_by_period(np.arange(2000) / 50, still_g, GRAVITY_M_S2) is None


def test_a_sensor_beside_the_rope_near_the_load_does_not_double_the_period() -> None:
    """It reads the swing's own frequency along the rope: as much as across it, but less than twice that frequency."""
    time_w0, motion = swing_from(97.0)
    force_g, still_g = readings_g(motion, 0.97)
    force_g[:, 2] += 0.05 * still_g[:, 0] / np.abs(still_g[:, 0]).max()
    found = present(rope_length_by_period(time_w0 * np.sqrt(0.75 / GRAVITY_M_S2), force_g, GRAVITY_M_S2))
    assert found.length_m == pytest.approx(0.75, rel=0.05)
