"""Recordings of the two axes in the plane of a swing."""

import numpy as np
import pytest

from gateway.swing.offline import estimate_planar_swing, estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.held_pendulum import GRAVITY_M_S2, readings_g, swing

RIG = MountedHousing(length_m=0.8, position_m=0.4, position_u_m=0.01, zero_g_offset_u_g=(0.01, 0.01, 0.01))


@pytest.mark.slow
@pytest.mark.parametrize("beside_deg", [0.0, 12.0])
def test_two_axes_show_a_swing_in_their_plane(beside_deg: float) -> None:
    amplitude_rad = np.radians([30.0])
    time_w0, motion = swing(amplitude_rad, 0 * amplitude_rad, np.array([0.003]), 8)
    force_g = readings_g(motion[:, 0], 0.5)[0]
    force_g = np.round((force_g + np.random.default_rng(3).normal(0.0, 0.004, force_g.shape)) / 0.016) * 0.016
    force_g[:, 0] *= np.cos(np.radians(beside_deg))
    force_g[:, 1] = 0.0
    time_s = time_w0 * np.sqrt(0.8 / GRAVITY_M_S2)
    found = estimate_planar_swing(time_s, force_g, rig=RIG)
    assert found.coverage95_rad is not None
    low_deg, high_deg = np.degrees(found.coverage95_rad)
    assert 20.0 < low_deg < 30.0 < high_deg < 40.0
    assert found.reasons[0].startswith("y is not recorded")
    assert estimate_swing(time_s, force_g, rig=RIG).swinging is None
