"""The swing estimator on rigid pendulums by MuJoCo: what the rig does not know is in the interval."""

import numpy as np
import pytest

from gateway.pipeline.rig import UNCALIBRATED, Rig
from gateway.swing.estimate import SwingEstimate
from gateway.swing.model.mount import rotation
from gateway.swing.offline import estimate_swing
from tests.blind.mechanics import Array
from tests.blind.rigid_pendulum import GRAVITY_M_S2, RigidMotion, RigidPendulum, simulate

pytestmark = pytest.mark.slow


def sampled(motion: RigidMotion, rate_hz: float, noise_g: float = 4e-4, step_g: float = 1e-4) -> tuple[Array, Array]:
    time_s = np.arange(0, motion.time_s[-1], 1 / rate_hz)
    force_g = np.stack([np.interp(time_s, motion.time_s, axis) for axis in motion.force_g.T], axis=1)
    force_g += noise_g * np.random.default_rng(3).normal(size=force_g.shape)
    return time_s, step_g * np.round(force_g / step_g)


def rig(length_m: float, position_m: float) -> Rig:
    return Rig.model_validate({"rope": {"length_m": length_m}, "housing": {"position_m": position_m}})


def half_width_deg(estimate: SwingEstimate, true_rad: float) -> float:
    assert estimate.coverage95_rad is not None, estimate.reasons
    low, high = estimate.coverage95_rad
    assert low <= true_rad <= high, np.degrees([low, true_rad, high])
    return float(np.degrees(high - low) / 2)


def test_the_engine_swings_with_the_period_of_the_equivalent_simple_pendulum() -> None:
    body = RigidPendulum(line_m=0.4, bob_radius_m=0.1, rod_mass_ratio=0.5, sensor_m=0.4)
    motion = simulate(body, 0.01, 0.3, 0.0, 10.0)
    across = motion.force_g[:, 0]
    crossings_s = motion.time_s[1:][(across[:-1] < 0) & (across[1:] >= 0)]
    assert np.diff(crossings_s).mean() == pytest.approx(2 * np.pi * np.sqrt(body.equivalent_m / GRAVITY_M_S2), rel=1e-3)


@pytest.mark.parametrize("rho", [0.2, 0.5, 0.95])
def test_a_mount_askew_by_seven_degrees_is_not_a_lean(rho: float) -> None:
    body = RigidPendulum(line_m=14.0, sensor_m=rho * 14.0, damping_ratio=0.002)
    motion = simulate(body, np.radians(6.0), 0.5, 0.0, 75.0)
    time_s, force_g = sampled(motion, 50.0)
    askew_g = force_g @ rotation(np.radians([0.0, 7.5])).T
    estimate = estimate_swing(time_s, askew_g, rig=rig(14.0, rho * 14.0).mounted_housing())
    assert half_width_deg(estimate, np.radians(6.0)) < 1.0
    assert estimate.phi_max_rad == pytest.approx(np.radians(6.0), abs=np.radians(0.5))


@pytest.mark.parametrize("askew_deg", [21.0, 30.0])
def test_a_housing_far_askew_is_answered(askew_deg: float) -> None:
    body = RigidPendulum(line_m=0.5, sensor_m=0.35, damping_ratio=0.003)
    motion = simulate(body, np.radians(18.0), 1.0, 0.0, 25.0)
    time_s, force_g = sampled(motion, 100.0)
    askew_g = force_g @ rotation(np.radians([-0.8 * askew_deg, 0.6 * askew_deg])).T
    estimate = estimate_swing(time_s, askew_g, rig=rig(0.55, 0.35).mounted_housing(UNCALIBRATED))
    assert half_width_deg(estimate, np.radians(18.0)) < 4.0


def test_a_stated_mount_and_offset_are_taken_out() -> None:
    body = RigidPendulum(line_m=5.0, sensor_m=2.5, damping_ratio=0.002)
    time_s, force_g = sampled(simulate(body, np.radians(8.0), 0.0, 0.0, 40.0), 50.0)
    stated = rig(5.0, 2.5).model_dump()
    stated["housing"] |= {"mount_deg": [3.0, -8.0], "mount_u_deg": 0.1}
    stated["sensor"] |= {"offset_mg": [30.0, -20.0, 10.0], "scale": [1.02, 1.0, 0.98]}
    readings_g = (force_g @ rotation(np.radians([3.0, -8.0])).T) * [1.02, 1.0, 0.98] + [0.03, -0.02, 0.01]
    described = Rig.model_validate(stated)
    np.testing.assert_allclose(described.correct(readings_g), force_g, atol=1e-12)
    estimate = estimate_swing(time_s, described.correct(readings_g), rig=described.mounted_housing())
    assert half_width_deg(estimate, np.radians(8.0)) < 0.3


def test_a_place_that_is_off_by_six_percent_is_in_the_interval() -> None:
    body = RigidPendulum(line_m=0.4, bob_radius_m=0.03, rod_mass_ratio=0.2, sensor_m=0.38, beside_m=(0.02, 0.0))
    time_s, force_g = sampled(simulate(body, np.radians(25.0), 0.4, 0.0, 20.0), 50.0)
    estimate = estimate_swing(time_s, force_g, rig=rig(0.4, 1.06 * 0.38).mounted_housing(UNCALIBRATED))
    assert half_width_deg(estimate, np.radians(25.0)) < 4.0


def test_a_decay_by_dry_friction_is_one_free_swing() -> None:
    body = RigidPendulum(line_m=3.0, sensor_m=1.5, damping_ratio=0.001, friction=0.003)
    time_s, force_g = sampled(simulate(body, np.radians(20.0), 0.4, 0.0, 60.0), 50.0)
    estimate = estimate_swing(time_s, force_g, rig=rig(3.0, 1.5).mounted_housing())
    assert half_width_deg(estimate, np.radians(20.0)) < 0.5
    assert estimate.hoists_s == ()
    assert estimate.friction_rad == pytest.approx(0.003, rel=0.1)


def test_coarse_steps_and_a_slow_rate_are_answered() -> None:
    body = RigidPendulum(line_m=0.6, sensor_m=0.55, damping_ratio=0.004)
    time_s, force_g = sampled(simulate(body, np.radians(35.0), 0.4, 0.0, 25.0), 12.5, 2e-3, 0.016)
    estimate = estimate_swing(time_s, force_g, rig=rig(0.65, 0.55).mounted_housing(UNCALIBRATED))
    assert half_width_deg(estimate, np.radians(35.0)) < 4.0


@pytest.mark.parametrize(
    ("rho", "tilt_deg"), [(0.0, 95.0), (0.0, 110.0), (0.4, 75.0), (0.4, 125.0), (0.9, 85.0), (0.9, 140.0)]
)
def test_a_rigid_link_may_swing_above_its_pivot(rho: float, tilt_deg: float) -> None:
    """60 to 140 degrees and every place on the link: coordinates are no limit."""
    body = RigidPendulum(
        line_m=0.6, bob_radius_m=0.03, rod_mass_ratio=0.2, sensor_m=rho * 0.6, damping_ratio=0.003, friction=0.001
    )
    time_s, force_g = sampled(simulate(body, np.radians(tilt_deg), 0.6, 0.0, 20.0), 50.0, 1e-3)
    estimate = estimate_swing(time_s, force_g, rig=rig(0.6, rho * 0.6).mounted_housing(UNCALIBRATED))
    assert half_width_deg(estimate, np.radians(tilt_deg)) < 5.0
    assert estimate.length_m == pytest.approx(body.equivalent_m, rel=0.01)


def test_a_wide_swing_that_is_not_planar_is_answered() -> None:
    body = RigidPendulum(line_m=0.6, sensor_m=0.3, damping_ratio=0.003)
    motion = simulate(body, np.radians(100.0), 0.6, 1.5, 20.0)
    time_s, force_g = sampled(motion, 50.0, 1e-3)
    estimate = estimate_swing(time_s, force_g, rig=rig(0.6, 0.3).mounted_housing())
    assert half_width_deg(estimate, float(motion.angle_rad.max())) < 3.0


@pytest.mark.parametrize(("tilt_deg", "limit_g"), [(50.0, 1.5), (75.0, 2.0), (105.0, 2.0)])
def test_axial_readings_clipped_at_the_lowest_point_are_spared(tilt_deg: float, limit_g: float) -> None:
    body = RigidPendulum(line_m=0.4, sensor_m=0.38, beside_m=(0.01, 0.0), damping_ratio=0.003, friction=0.001)
    time_s, force_g = sampled(simulate(body, np.radians(tilt_deg), 0.4, 0.0, 15.0), 100.0, 2e-3, 0.004)
    clipped_g = np.minimum(force_g, [9, 9, limit_g])
    assert (clipped_g[:, 2] == limit_g).mean() > 0.05
    estimate = estimate_swing(time_s, clipped_g, rig=rig(0.4, 0.38).mounted_housing(UNCALIBRATED))
    assert half_width_deg(estimate, np.radians(tilt_deg)) < 4.0
    assert any("clipped" in reason for reason in estimate.reasons)


def test_a_transverse_axis_that_is_clipped_is_a_fault() -> None:
    """It loses the turning points."""
    body = RigidPendulum(line_m=0.4, sensor_m=0.1, damping_ratio=0.003)
    time_s, force_g = sampled(simulate(body, np.radians(60.0), 0.4, 0.0, 15.0), 100.0)
    estimate = estimate_swing(time_s, np.minimum(force_g, [0.4, 9, 9]), rig=rig(0.4, 0.1).mounted_housing())
    assert estimate.swinging is None
    assert "clipped: many readings of x" in estimate.reasons[0]
