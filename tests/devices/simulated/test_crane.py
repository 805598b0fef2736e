"""The simulated crane against closed forms: each answer here was known before the crane was run."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from devices.pendulum import pendulum
from devices.simulated.crane import HISTORY_S, Crane
from devices.simulated.demo import CALM_SWING_RAD, demo_crane, demo_events
from devices.simulated.schedule import Event, Gust, Hoist, Schedule, TrolleyMove

Array = NDArray[np.float64]
G = 9.80665


def swing(phi_max_deg: float, position_m: float, damping_ratio: float = 0.0) -> Crane:
    """A planar swing let go at rest from `phi_max_deg` toward world x."""
    motion = pendulum.start_motion(np.radians(phi_max_deg), 0.0, 0.0, 0.0)
    return Crane(length_m=5.0, position_m=position_m, motion=motion, damping_ratio=damping_ratio)


def test_a_load_that_hangs_reads_one_g_along_the_rope() -> None:
    crane = Crane(length_m=8.0, position_m=6.0, gravity_m_s2=9.81)
    assert crane.specific_force_m_s2(np.linspace(0, 5, 50)) == pytest.approx(
        np.tile([0.0, 0.0, 9.81], (50, 1)), abs=1e-12
    )


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.5, 1.0])
def test_planar_swing_reads_the_specific_force_of_the_closed_form(rho: float) -> None:
    phi_max = np.radians(10.0)
    crane, time_s = swing(10.0, rho * 5.0), np.arange(0, 30, 0.01)
    force, phi = crane.specific_force_m_s2(time_s), crane.truth(time_s).rope_angle_rad
    transverse, axial = np.hypot(force[:, 0], force[:, 1]), force[:, 2]
    assert transverse == pytest.approx((1 - rho) * G * np.sin(phi), abs=2e-6)
    assert axial == pytest.approx(G * np.cos(phi) + 2 * rho * G * (np.cos(phi) - np.cos(phi_max)), abs=2e-6)


def test_the_published_formulas_disagree_at_mid_rope() -> None:
    force = swing(10.0, 2.5).specific_force_m_s2(np.arange(0, 10, 0.002)) / G
    transverse, least, most = np.abs(force[:, 0]).max(), force[:, 2].min(), force[:, 2].max()
    read = [np.arccos(least), np.arcsin(transverse), np.arctan(transverse / least), np.arccos(1.5 - most / 2)]
    assert np.degrees(read) == pytest.approx([10.00, 4.98, 5.04, 7.07], abs=0.01)


def test_the_period_increases_with_amplitude_as_in_theory() -> None:
    amplitude = np.radians(10.0)
    period_s = 2 * np.pi * np.sqrt(5.0 / G) * (1 + amplitude**2 / 16 + 11 * amplitude**4 / 3072)
    angle = swing(10.0, 2.5).truth(np.array([5 * period_s])).rope_angle_rad
    assert np.degrees(angle) == pytest.approx([10.0], abs=1e-5)


@pytest.mark.slow
def test_energy_and_angular_momentum_are_conserved_without_a_drive() -> None:
    motion = pendulum.start_motion(np.radians(9.0), np.radians(-3.0), 0.05, 0.12)
    crane = Crane(length_m=3.0, position_m=2.0, motion=motion)
    middle_s = np.arange(0.5, 120, 0.5)
    n = crane.truth((middle_s[:, None] + [-1e-3, 0.0, 1e-3]).ravel()).direction.reshape(-1, 3, 3)
    n_rate = (n[:, 2] - n[:, 0]) / 2e-3
    momentum = n[:, 1, 0] * n_rate[:, 1] - n[:, 1, 1] * n_rate[:, 0]
    energy = 3.0 / 2 * np.sum(n_rate**2, axis=1) + G * n[:, 1, 2]
    assert np.ptp(momentum) < 1e-5 * abs(momentum.mean())
    assert np.ptp(energy) < 1e-5 * np.ptp(G * n[:, 1, 2])


@pytest.mark.slow
def test_conical_swing_keeps_its_angle_and_its_rate() -> None:
    phi, length_m = np.radians(6.0), 4.0
    rate_rad_s = np.sqrt(G / (length_m * np.cos(phi)))
    motion = pendulum.start_motion(phi, 0.0, 0.0, rate_rad_s * np.sin(phi))
    truth = Crane(length_m=length_m, position_m=2.0, motion=motion).truth(np.arange(0, 60, 0.1))
    assert np.degrees(truth.rope_angle_rad) == pytest.approx(6.0, abs=1e-4)
    azimuth = np.unwrap(np.arctan2(truth.direction[:, 1], truth.direction[:, 0]))
    assert azimuth[-1] == pytest.approx(rate_rad_s * 59.9, rel=1e-6)


def test_steady_wind_leans_the_rope_by_its_force_over_the_weight() -> None:
    lean = np.arctan(0.5 / G)
    hanging = pendulum.start_motion(lean, 0.0, 0.0, 0.0)
    crane = Crane(length_m=6.0, position_m=3.0, motion=hanging, wind_m_s2=(0.5, 0.0))
    time_s = np.linspace(0, 20, 100)
    assert crane.truth(time_s).rope_angle_rad == pytest.approx(lean, abs=1e-10)
    expected = np.tile([G * np.sin(lean), 0.0, G * np.cos(lean)], (100, 1))
    assert crane.specific_force_m_s2(time_s) == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_the_housing_sees_the_vertical_where_the_sensor_reads_it() -> None:
    crane = Crane(length_m=6.0, position_m=3.0, motion=pendulum.start_motion(0.08, -0.05, 0.0, 0.0))
    at_pivot = Crane(length_m=6.0, position_m=0.0, motion=pendulum.start_motion(0.08, -0.05, 0.0, 0.0))
    time_s = np.linspace(0, 20, 200)
    up = crane.truth(time_s).up_in_housing
    assert at_pivot.specific_force_m_s2(time_s) == pytest.approx(G * up, abs=1e-12)
    angle = np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])
    assert angle == pytest.approx(crane.truth(time_s).rope_angle_rad, abs=1e-9)


def test_the_response_to_a_trolley_move_is_that_of_the_linear_pendulum() -> None:
    """A short push of speed v leaves the swing -v/(L w) sin(w t) along it; its width takes off (w ramp)^2/56."""
    length_m, speed_m_s, ramp_s = 8.0, 0.02, 0.5
    move = TrolleyMove(start_s=0.5, duration_s=1000.0, ramp_s=ramp_s, speed_m_s=speed_m_s, azimuth_rad=0.3)
    crane = Crane(length_m=length_m, position_m=8.0, events=[move])
    time_s, w = np.arange(1, 20, 0.05), np.sqrt(G / length_m)
    along = crane.truth(time_s).direction @ [np.cos(0.3), np.sin(0.3), 0.0]
    swing_rad = speed_m_s / (length_m * w)
    linear = -swing_rad * (1 - (w * ramp_s) ** 2 / 56) * np.sin(w * (time_s - 0.5 - ramp_s / 2))
    assert along == pytest.approx(linear, abs=1e-4 * swing_rad)


def test_the_amplitude_decays_by_the_stated_damping_ratio() -> None:
    period_s = 2 * np.pi * np.sqrt(5.0 / G)
    truth = swing(2.0, 2.0, damping_ratio=0.01).truth(np.arange(0, 11 * period_s, 0.01))
    late = truth.rope_angle_rad[-round(period_s / 0.01) :].max()
    assert late == pytest.approx(np.radians(2.0) * np.exp(-2 * np.pi * 0.01 * 10.25), rel=0.02)


def test_housing_keeps_its_distance_to_the_load_while_hoisting() -> None:
    crane = Crane(length_m=10.0, position_m=7.0, events=[Hoist(start_s=5, duration_s=10, by_m=-2.0)])
    time_s = np.arange(0, 25, 0.05)
    truth, force = crane.truth(time_s), crane.specific_force_m_s2(time_s)
    assert truth.length_m - truth.position_m == pytest.approx(3.0, abs=1e-12)
    assert truth.length_m[[0, -1]] == pytest.approx([10.0, 8.0], abs=1e-12)
    assert truth.rho[-1] == pytest.approx(5 / 8)
    # the load speeds up and down along the vertical: what the sensor sees beyond g integrates to no speed, and to 2 m
    beyond = force[:, 2] - G
    speed = np.cumsum(beyond) * 0.05
    assert np.abs(beyond).max() > 0.05
    assert speed[-1] == pytest.approx(0.0, abs=1e-6)
    assert speed.sum() * 0.05 == pytest.approx(2.0, rel=1e-3)


def test_swinging_while_hoisting_reads_the_housings_own_acceleration() -> None:
    """The housing's path r n, differentiated twice, plus g: nothing of the crane's own formula is in this."""
    motion = pendulum.start_motion(np.radians(8.0), np.radians(2.0), 0.0, 0.1)
    crane = Crane(length_m=6.0, position_m=4.0, motion=motion, events=[Hoist(start_s=1, duration_s=6, by_m=2.5)])
    time_s, step_s = np.arange(1.5, 6.5, 0.1), 0.01
    around = crane.truth((time_s[:, None] + [-step_s, 0.0, step_s]).ravel())
    path = (around.position_m[:, None] * around.direction).reshape(-1, 3, 3)
    acceleration = (path[:, 0] - 2 * path[:, 1] + path[:, 2]) / step_s**2
    in_world = acceleration + np.array([0.0, 0.0, G])
    force = crane.specific_force_m_s2(time_s)
    assert np.linalg.norm(force, axis=1) == pytest.approx(np.linalg.norm(in_world, axis=1), abs=2e-4)
    along_rope = -np.einsum("ni,ni->n", around.direction.reshape(-1, 3, 3)[:, 1], in_world)
    assert force[:, 2] == pytest.approx(along_rope, abs=2e-4)
    assert np.hypot(force[:, 0], force[:, 1]) == pytest.approx(
        np.sqrt(np.sum(in_world**2, axis=1) - along_rope**2), abs=5e-4
    )


def test_labels_state_the_drive_of_the_load() -> None:
    events: list[Event] = [
        TrolleyMove(start_s=1, duration_s=10, ramp_s=2, speed_m_s=0.5, azimuth_rad=0.0),
        TrolleyMove(start_s=4, duration_s=4, ramp_s=1, speed_m_s=0.5, azimuth_rad=1.6),
        Gust(start_s=14, duration_s=4, force_m_s2=0.3, azimuth_rad=2.0),
        Hoist(start_s=16, duration_s=4, by_m=0.5),
    ]
    truth = Crane(length_m=6.0, position_m=5.0, events=events).truth(
        np.array([0.5, 2, 3.5, 4.5, 6, 10, 13, 15, 17, 19, 21])
    )
    assert truth.trolley.astype(int).tolist() == [0, 1, 0, 1, 0, 1, 0, 0, 0, 0, 0]
    assert truth.gust.astype(int).tolist() == [0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0]
    assert truth.hoisting.astype(int).tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0]
    assert truth.free.astype(int).tolist() == [1, 0, 1, 0, 1, 0, 1, 0, 0, 0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("length_m", [2.0, 12.0])
def test_agrees_with_an_adaptive_integrator(length_m: float) -> None:
    def events() -> Schedule:
        random = np.random.default_rng([3, 0])
        azimuth_rad = random.uniform(-np.pi, np.pi)  # drawn before the events
        return Schedule(itertools.islice(demo_events(random, length_m, azimuth_rad, G), 12), length_m)

    random, schedule = np.random.default_rng([3, 0]), events()
    azimuth_rad = random.uniform(-np.pi, np.pi)
    tilts = CALM_SWING_RAD * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    damping = 2 * 0.006 * np.sqrt(G / length_m)

    def rate(time_s: float, flat: Array) -> Array:
        motion, drive = flat.reshape(3, 3), schedule.at(np.array([time_s]))
        outside = drive.force_m_s2[0] - drive.pivot_acceleration_m_s2[0] - np.array([0.0, 0.0, G])
        acting = outside - damping * drive.length_m[0] * motion[1]
        return pendulum.motion_rate(motion, acting, drive.length_m[0], drive.length_rate_m_s[0]).ravel()

    time_s = np.arange(0, 40, 0.037)
    start = pendulum.start_motion(tilts[0], tilts[1], 0.0, 0.0).ravel()
    best = solve_ivp(rate, (0, 40), start, method="DOP853", rtol=1e-9, atol=1e-11, t_eval=time_s, max_step=0.25)
    found = demo_crane(3, length_m, 0.7 * length_m).truth(time_s).direction
    assert found == pytest.approx(best.y.T[:, :3], abs=2e-6)  # 1e-4 degrees


@pytest.mark.slow
@pytest.mark.parametrize("odr_hz", [125.0, 1000.0])
def test_results_do_not_depend_on_the_blocks(odr_hz: float) -> None:
    time_s = np.arange(int(70 * odr_hz)) / odr_hz
    whole, split = demo_crane(5, 8.0, 6.0), demo_crane(5, 8.0, 6.0)
    cuts = np.cumsum(np.random.default_rng(0).choice([1, 2, 7, 32, 129, 500], 20_000))
    parts = np.split(time_s, cuts[cuts < len(time_s)])
    assert np.array_equal(
        whole.specific_force_m_s2(time_s), np.concatenate([split.specific_force_m_s2(part) for part in parts])
    )


@pytest.mark.slow
def test_the_truth_is_available_for_the_history_only() -> None:
    crane = demo_crane(1, 8.0, 6.0)
    crane.specific_force_m_s2(np.arange(0, 200, 0.1))
    young = np.array([200 - HISTORY_S])
    assert crane.truth(young).rope_angle_rad == pytest.approx(demo_crane(1, 8.0, 6.0).truth(young).rope_angle_rad)
    with pytest.raises(ValueError, match="is before that"):
        crane.truth(np.array([1.0]))


@pytest.mark.slow
@pytest.mark.parametrize("length_m", [4.0, 12.0, 30.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_every_round_of_the_demonstration_swings_calmly_then_hastily_then_is_caught(seed: int, length_m: float) -> None:
    period_s = 2 * np.pi * np.sqrt(length_m / G)
    calm_s = np.ceil(25 / period_s + 0.25) * period_s
    crane, turn_s = demo_crane(seed, length_m, 0.8 * length_m), 0.0
    for _ in range(4):
        time_s = np.arange(turn_s, turn_s + calm_s + 10 * period_s, 0.05)
        angle_deg, since_s = np.degrees(crane.truth(time_s).rope_angle_rad), time_s - turn_s - calm_s
        assert 1.3 < angle_deg[(since_s > -period_s) & (since_s < 0)].max() < angle_deg[since_s < 0].max() < 2.1
        assert 7 < angle_deg[(since_s > 0) & (since_s < 3 * period_s)].max() < 8.5
        assert angle_deg[since_s > 4 * period_s].max() < 0.5
        turn_s += calm_s + 11.75 * period_s


@pytest.mark.slow
def test_the_demonstration_continues_within_bounds() -> None:
    crane = demo_crane(2, 3.0, 2.0)
    time_s = np.arange(0, 900, 0.1)
    truth = crane.truth(time_s)
    assert np.degrees(truth.rope_angle_rad).max() < 9
    assert truth.length_m.min() == pytest.approx(3.0)
    assert truth.length_m.max() == pytest.approx(3.75)
    assert np.abs(np.linalg.norm(truth.direction, axis=1) - 1).max() < 2e-8
    assert len(crane._schedule._events) < 20
    assert all(kind[time_s > 600].any() for kind in (truth.trolley, truth.gust, truth.hoisting, truth.free))


def test_the_seed_determines_the_crane() -> None:
    time_s = np.arange(0, 20, 0.1)
    first, again, other = (demo_crane(seed, 8.0, 6.0).specific_force_m_s2(time_s) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_a_housing_off_the_rope_is_refused() -> None:
    with pytest.raises(ValueError, match="position_m 7 must lie on the rope"):
        Crane(length_m=6.0, position_m=7.0)
