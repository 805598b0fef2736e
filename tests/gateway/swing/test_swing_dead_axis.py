"""A dead axis that reads noise is reported; a swing along an axis is not mistaken for one."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.conftest import Recording, simulate
from tests.values import present

pytestmark = pytest.mark.slow

NOISE_G = 4e-4
RIG: dict[str, Any] = {"position_u_m": 0.05, "zero_g_offset_u_g": (5e-4,) * 3, "scale_u": (3e-4,) * 3}


def housing(recording: Recording) -> MountedHousing:
    return MountedHousing(length_m=9.5, position_m=recording.position_m, **RIG)


def deadened(recording: Recording, axis: int, level_g: float) -> NDArray[np.float64]:
    force_g = recording.force_g.copy()
    force_g[:, axis] = level_g + NOISE_G * np.random.default_rng(9).normal(size=len(force_g))
    return force_g


@pytest.mark.parametrize(
    ("rho", "azimuth_deg", "axis"),
    [(0.1, 35, 1), (0.5, 35, 0), (0.5, 60, 0), (0.5, 0, 0), (0.1, 60, 2), (0.5, 15, 2)],
)
def test_a_noisy_dead_axis_is_reported(rho: float, azimuth_deg: int, axis: int) -> None:
    recording = simulate(rho=rho, azimuth_deg=azimuth_deg, amplitude_deg=6, duration_s=45)
    force_g = deadened(recording, axis, 0.998 if axis == 2 else 0.01)

    estimate = estimate_swing(recording.time_s, force_g, rig=housing(recording), noise_g=NOISE_G)

    assert estimate.swinging is None
    assert estimate.coverage95_rad is None
    assert "dead axis" in estimate.reasons[0]
    assert "xyz"[axis] in estimate.reasons[0].split(" shows")[0]


def test_a_recording_that_never_changes_is_named_as_dead() -> None:
    time_s = np.arange(3000) / 50.0
    estimate = estimate_swing(
        time_s, np.tile([0.0, 0.0, 1.0], (3000, 1)), rig=MountedHousing(length_m=14.0, position_m=9.0)
    )
    assert estimate.swinging is None
    assert "x does not change at all" in estimate.reasons[0]


@pytest.mark.parametrize("rho", [0.1, 0.8])
@pytest.mark.parametrize("azimuth_deg", [0, 90, 3, 45])
def test_a_planar_swing_along_any_azimuth_has_no_dead_axis(rho: float, azimuth_deg: int) -> None:
    recording = simulate(rho=rho, azimuth_deg=azimuth_deg, amplitude_deg=6, duration_s=40)

    estimate = estimate_swing(recording.time_s, recording.force_g, rig=housing(recording), noise_g=NOISE_G)

    assert estimate.swinging
    assert estimate.phi_max_rad == pytest.approx(recording.phi_max_rad, abs=4 * present(estimate.u_rad))
    assert present(estimate.u_rad) < 0.02 * recording.phi_max_rad


@pytest.mark.parametrize(("rho", "azimuth_deg"), [(0.5, 15), (0.8, 35)])
def test_the_interval_includes_both_cases_where_a_dead_axis_cannot_be_decided(rho: float, azimuth_deg: int) -> None:
    """Near x a dead y takes little, and near the load the housing's place explains as much."""
    recording = simulate(rho=rho, azimuth_deg=azimuth_deg, amplitude_deg=6, duration_s=45)
    force_g = deadened(recording, 1, 0.0)

    estimate = estimate_swing(recording.time_s, force_g, rig=housing(recording), noise_g=NOISE_G)

    low, high = present(estimate.coverage95_rad)
    assert low < recording.phi_max_rad < high
