"""A rope whose length changes: the spline, the equations and whole recordings."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.pendulum import pendulum
from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.simulated.crane import Crane, GroundTruth
from devices.simulated.schedule import Hoist, TrolleyMove
from gateway.swing.data.bins import single_samples
from gateway.swing.fit.gauss_newton import linearise
from gateway.swing.fit.priors import hoisting_prior
from gateway.swing.model.motion import PendulumMotion, ShootingGrid
from gateway.swing.model.rope_spline import SplineGrid
from gateway.swing.model.spherical_pendulum import SensorPlacement, TrajectoryInput, integrate, specific_force_g
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.values import present

NOISE_G = 4e-4
TIME_S = np.arange(50 * 50) / 50.0
HOIST_S = (15.0, 27.0)


def recorded(
    by_m: float, *, rho: float = 0.5, length_m: float = 9.0, events: list[TrolleyMove] | None = None
) -> tuple[NDArray[np.float64], GroundTruth]:
    """Specific force in g of a swing during which the rope's length changes, and the truth."""
    crane = Crane(
        length_m=length_m,
        position_m=rho * length_m,
        events=[Hoist(HOIST_S[0], HOIST_S[1] - HOIST_S[0], by_m)] if events is None else events,
        motion=start_motion(0.12, 0.0, 0.0, 0.02),
        damping_ratio=0.002,
    )
    force_g = crane.specific_force_m_s2(TIME_S) / STANDARD_GRAVITY_M_S2
    return force_g + NOISE_G * np.random.default_rng(3).normal(size=force_g.shape), crane.truth(TIME_S)


def clamped(rho: float = 0.5, length_m: float = 9.0) -> MountedHousing:
    return MountedHousing(length_m=1.1 * length_m, above_load_m=(1 - rho) * length_m)


@pytest.mark.slow
def test_length_speed_and_acceleration_of_a_spline_are_consistent() -> None:
    splines = SplineGrid.covering(2.0, 5.0, 0.5)
    time_s = np.linspace(0, 8, 80001)
    speeds = np.random.default_rng(0).normal(size=splines.count)

    rope = splines.evaluate(time_s, 3.0, speeds)

    assert np.gradient(rope.length_m, time_s) == pytest.approx(rope.rate_m_s, abs=1e-6)
    assert np.gradient(rope.rate_m_s, time_s)[1:-1] == pytest.approx(rope.acceleration_m_s2[1:-1], abs=1e-3)
    assert (rope.length_m[0], rope.length_m[-1]) == pytest.approx((3.0, 3.0 + 0.5 * speeds.sum()))


def test_transfer_to_another_grid_keeps_the_length() -> None:
    splines, later = SplineGrid.covering(2.0, 5.0, 0.5), SplineGrid.covering(3.2, 7.0, 0.5)
    speeds = np.random.default_rng(1).normal(size=splines.count)
    time_s = np.linspace(3.2, 5.0, 50)

    speeds_later, added_m = splines.transfer(later, speeds)

    expected_m = splines.evaluate(time_s, 3.0, speeds).length_m
    assert later.evaluate(time_s, 3.0 + added_m, speeds_later).length_m == pytest.approx(expected_m)


@pytest.mark.slow
@pytest.mark.parametrize("goes_with_the_rope", [True, False])
def test_equations_agree_with_the_simulated_crane(goes_with_the_rope: bool) -> None:
    """A rope that becomes longer at a constant speed, and one whose speed changes."""
    gravity, step_s, steps = STANDARD_GRAVITY_M_S2, 0.02, 500
    half_s = step_s / 2 * np.arange(2 * steps + 1)
    length_m, rate_m_s, second_m_s2 = 9 + 0.3 * half_s + 0.02 * half_s**2, 0.3 + 0.04 * half_s, 0.04

    def rate(time_s: float, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        at = round(2 * time_s / step_s)
        return pendulum.motion_rate(motion, np.array([0.0, 0.0, -gravity]), length_m[at], rate_m_s[at])

    motions = [start_motion(0.3, -0.1, 0.05, 0.2)]
    for step in range(steps):
        motions.append(pendulum.runge_kutta_step(rate, step * step_s, motions[-1], step_s))
    position_m = length_m[::2] - 4.0 if goes_with_the_rope else np.full(steps + 1, 5.0)
    moves = 1.0 if goes_with_the_rope else 0.0
    forces = [
        pendulum.specific_force_m_s2(
            m, rate(i * step_s, m)[1], np.zeros(3), gravity, position_m[i], moves * rate_m_s[2 * i], moves * second_m_s2
        )
        for i, m in enumerate(motions)
    ]

    axes = pendulum.housing_axes(motions[0])
    first = [axes @ [0.0, 0.0, -1.0], axes @ motions[0][1], np.zeros(3)]
    start = np.array([[[v[0] + 1j * v[1]]] for v in first])
    start[0] *= 2 / (1 - first[0][2])
    course = TrajectoryInput((gravity / length_m)[:, None, None], np.zeros(1), (rate_m_s / length_m)[:, None, None])
    trajectory = integrate(start, course, step_s, steps)
    states = trajectory.state[:, :, 0]
    place = SensorPlacement(
        np.asarray(position_m[:, None] / gravity),
        np.asarray(moves * rate_m_s[::2, None] / gravity),
        moves * second_m_s2 / gravity,
    )
    modelled_g = np.stack([specific_force_g(states, course.at(2 * i), place)[i, :, 0] for i in range(0, steps + 1, 50)])

    assert modelled_g == pytest.approx(np.array(forces)[::50] / gravity, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("by_m", "rho"), [(-3.0, 0.5), (4.0, 0.3)])
def test_a_recording_with_a_hoist_has_an_interval_that_covers(by_m: float, rho: float) -> None:
    force_g, truth = recorded(by_m, rho=rho)

    estimate = estimate_swing(TIME_S, force_g, rig=clamped(rho), noise_g=NOISE_G)

    low, high = present(estimate.coverage95_rad)
    assert low < truth.rope_angle_rad.max() < high
    assert present(estimate.u_rad) < 0.02 * present(estimate.phi_max_rad)
    assert any("hoisting within" in reason for reason in estimate.reasons)
    begin_s, end_s = estimate.hoists_s[0][0], estimate.hoists_s[-1][1]
    assert (begin_s, end_s) == pytest.approx(HOIST_S, abs=3.0)


@pytest.mark.slow
def test_a_move_of_the_trolley_is_not_reported_as_hoisting() -> None:
    force_g, _ = recorded(0.0, events=[TrolleyMove(20.0, 6.0, 1.5, 0.8, 0.4)])

    estimate = estimate_swing(TIME_S, force_g, rig=clamped(), noise_g=NOISE_G)

    assert estimate.hoists_s == ()
    assert estimate.coverage95_rad is None


@pytest.mark.parametrize("speed_m_s", [-0.67, -0.9, 60.0])
def test_a_rope_that_is_hoisted_to_nothing_or_lowered_without_end_is_no_motion(speed_m_s: float) -> None:
    """13.2 s from 9 m: to 0.16 m, which is less than a fiftieth, to below nothing, and to 800 m."""
    splines = SplineGrid.covering(15.0, 27.0, 0.6)
    parameters = np.array([np.log(9.0), 0.002, *np.full(splines.count, speed_m_s)])
    grid = ShootingGrid.covering(0.0, 30.0, 6.0)
    nodes = np.full((3, grid.segments), 0.1 + 0.0j)
    motion = PendulumMotion(grid, nodes, parameters, STANDARD_GRAVITY_M_S2, splines)
    bins = single_samples(TIME_S[:1000], np.tile([0.0, 0.0, 1.0], (1000, 1)))
    prior = hoisting_prior(clamped(), splines.count)

    assert linearise(bins, np.ones((1000, 3)), motion, prior) is None
    still = replace(motion, parameters=np.array([np.log(9.0), 0.002, *np.full(splines.count, -0.3)]))
    assert linearise(bins, np.ones((1000, 3)), still, prior) is not None
