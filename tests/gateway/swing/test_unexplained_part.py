"""A swing of which a part remains unexplained, far above the sensor's noise."""

import numpy as np
import pytest

from gateway.numerics.array import Array
from gateway.swing.model.mount import rotation
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.held_pendulum import GRAVITY_M_S2, readings_g, swing

LENGTH_M = 0.19


def arm_on_a_yielding_stand(amplitude_deg: float, unexplained_g: float) -> tuple[Array, Array]:
    """Return times and readings below the centre of oscillation, with a force along the arm that lags as no pendulum's does."""
    amplitude_rad = np.radians([amplitude_deg])
    time_w0, motion = swing(amplitude_rad, 0 * amplitude_rad, np.array([0.004]), 15)
    force_g = readings_g(motion[:, 0], 1.4)[0]
    rate = np.gradient(motion[:, 0, 0, 0], time_w0)
    force_g[:, 2] += unexplained_g * np.sign(rate) * rate**2 / (rate**2).max()
    force_g = 0.97 * force_g @ rotation(np.radians([1.5, 0.5])).T
    force_g += np.random.default_rng(5).normal(0.0, 0.001, force_g.shape)
    return time_w0 * np.sqrt(LENGTH_M / GRAVITY_M_S2), force_g


@pytest.mark.slow
def test_an_arm_on_a_yielding_stand_has_an_interval() -> None:
    rig = MountedHousing(
        length_m=LENGTH_M,
        length_u_rel=0.066,
        position_m=1.4 * LENGTH_M,
        position_u_m=0.007,
        zero_g_offset_u_g=(0.02, 0.02, 0.02),
        scale_u=(0.01, 0.01, 0.01),
        cross_axis_u=0.01,
        mount_u_rad=None,
        beside_u_m=0.015,
    )
    found = estimate_swing(*arm_on_a_yielding_stand(60.0, 0.03), rig=rig)
    assert found.coverage95_rad is not None
    low_deg, high_deg = np.degrees(found.coverage95_rad)
    assert 30.0 < low_deg < 60.0 < high_deg < 90.0
    assert any("unexplained" in reason for reason in found.reasons)
