"""The equations of motion against closed forms."""

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.pendulum import pendulum
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2

LENGTH_M = 8.0
GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])
SMALL_SWING_PERIOD_S = 2 * np.pi * np.sqrt(LENGTH_M / STANDARD_GRAVITY_M_S2)


def rate(_time_s: float, motion: NDArray[np.float64]) -> NDArray[np.float64]:
    return pendulum.motion_rate(motion, GRAVITY, LENGTH_M, 0.0)


def swung(motion: NDArray[np.float64], steps: int, step_s: float) -> NDArray[np.float64]:
    motions = [motion]
    for i in range(steps):
        motions.append(pendulum.runge_kutta_step(rate, i * step_s, motions[-1], step_s))
    return np.array(motions)


def force_g(motion: NDArray[np.float64], position_m: float) -> NDArray[np.float64]:
    n_acceleration = rate(0.0, motion)[..., 1, :]
    force = pendulum.specific_force_m_s2(motion, n_acceleration, np.zeros(3), STANDARD_GRAVITY_M_S2, position_m)
    return force / STANDARD_GRAVITY_M_S2


def test_hanging_at_rest_reads_one_g_along_the_rope() -> None:
    motion = pendulum.start_motion(0.0, 0.0, 0.0, 0.0)

    assert np.array_equal(rate(0.0, motion), np.zeros((3, 3)))
    assert force_g(motion, 3.0) == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.slow
@pytest.mark.parametrize("amplitude_deg", [1.0, 10.0, 30.0])
def test_period_follows_its_series(amplitude_deg: float) -> None:
    amplitude = np.radians(amplitude_deg)
    step_s = SMALL_SWING_PERIOD_S / 400
    tilt = np.arctan2(
        *swung(pendulum.start_motion(amplitude, 0.0, 0.0, 0.0), 420, step_s)[:, 0, [0, 2]].T * [[1], [-1]]
    )
    falls, rises = (np.flatnonzero(np.diff(np.sign(tilt)) * sign > 0)[0] for sign in (-1, 1))
    crossings = [step_s * (i + tilt[i] / (tilt[i] - tilt[i + 1])) for i in (falls, rises)]

    period_s = 2 * (crossings[1] - crossings[0])

    # T0 (1 + A^2/16 + 11 A^4/3072); the next term is 173 A^6/737280
    series = SMALL_SWING_PERIOD_S * (1 + amplitude**2 / 16 + 11 * amplitude**4 / 3072)
    assert period_s == pytest.approx(series, rel=2 * 173 / 737280 * amplitude**6 + 1e-6)


@pytest.mark.slow
def test_energy_and_angular_momentum_about_the_vertical_stay() -> None:
    start = pendulum.start_motion(np.radians(25), np.radians(-5), 0.1, 0.3)
    n, n_rate = swung(start, 1500, 0.01)[:, :2].transpose(1, 0, 2)

    energy = 0.5 * LENGTH_M**2 * (n_rate**2).sum(axis=1) + STANDARD_GRAVITY_M_S2 * LENGTH_M * n[:, 2]
    momentum = np.cross(n, n_rate)[:, 2]

    assert np.ptp(energy) < 1e-6
    assert np.ptp(momentum) < 1e-8
    assert np.linalg.norm(n, axis=1) == pytest.approx(np.ones(len(n)), abs=1e-9)


@pytest.mark.slow
def test_housing_axes_stay_at_right_angles_and_do_not_turn_about_the_rope() -> None:
    motions = swung(pendulum.start_motion(0.4, 0.0, 0.0, 0.3), 600, 0.01)
    axes = pendulum.housing_axes(motions)
    turning = np.gradient(axes[:, 0], 0.01, axis=0)[2:-2] * axes[2:-2, 1]

    assert np.einsum("nij,nkj->nik", axes, axes) == pytest.approx(np.broadcast_to(np.eye(3), axes.shape), abs=1e-9)
    assert np.abs(turning.sum(axis=1)).max() < 1e-4  # x' has no part along y; carried by a universal joint it has 0.03


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.3, 0.5, 1.0])
def test_planar_swing_reads_the_extremes_that_the_formulas_invert(rho: float) -> None:
    amplitude = np.radians(12)
    start = pendulum.start_motion(amplitude * np.cos(0.6), 0.0, 0.0, 0.0)
    force = force_g(swung(start, 900, SMALL_SWING_PERIOD_S / 800), rho * LENGTH_M)
    reached = np.arccos(-start[0, 2])

    assert np.hypot(force[:, 0], force[:, 1]).max() == pytest.approx((1 - rho) * np.sin(reached), abs=1e-6)
    assert force[:, 2].min() == pytest.approx(np.cos(reached), abs=1e-6)
    assert force[:, 2].max() == pytest.approx(1 + 2 * rho * (1 - np.cos(reached)), abs=1e-5)


@pytest.mark.slow
def test_hoisting_keeps_the_angular_momentum_of_a_free_rope() -> None:
    """Without gravity L^2 n' is kept while the rope shortens."""
    motion = pendulum.start_motion(0.0, 0.0, 0.2, 0.0)
    hoist_m_s, step_s = -0.4, 0.005

    def rate_hoisting(time_s: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        return pendulum.motion_rate(state, np.zeros(3), LENGTH_M + hoist_m_s * time_s, hoist_m_s)

    for i in range(1000):
        motion = pendulum.runge_kutta_step(rate_hoisting, i * step_s, motion, step_s)
    length_m = LENGTH_M + hoist_m_s * 1000 * step_s

    assert length_m**2 * np.linalg.norm(motion[1]) == pytest.approx(LENGTH_M**2 * 0.2, rel=1e-6)


@pytest.mark.slow
def test_runge_kutta_gains_four_orders() -> None:
    start = pendulum.start_motion(0.3, 0.0, 0.0, 0.1)
    end = swung(start, 3200, 4 / 3200)[-1]
    coarse, fine = (np.abs(swung(start, n, 4 / n)[-1] - end).max() for n in (50, 100))

    assert coarse / fine == pytest.approx(16, rel=0.25)
