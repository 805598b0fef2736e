"""The housing-frame equations against the world-frame ones, and the interpolation between their steps."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.pendulum import pendulum
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, period_ratio
from gateway.swing.model.spherical_pendulum import (
    ForceField,
    SensorPlacement,
    equilibrium,
    integrate,
    interpolate,
    rope_angle,
    specific_force_g,
)

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2
LENGTH_M, POSITION_M, DAMPING_1_S = 20.0, 13.0, 0.02
PULL_M_S2 = np.array([0.3, -0.2, 0.0])
STEP_S, STEPS = 0.02, 1500


def world_rate(_time_s: float, motion: NDArray[np.float64]) -> NDArray[np.float64]:
    drive = np.array([0.0, 0.0, -GRAVITY_M_S2]) + PULL_M_S2 - DAMPING_1_S * LENGTH_M * motion[1]
    return pendulum.motion_rate(motion, drive, LENGTH_M, 0.0)


@pytest.fixture(scope="module")
def world() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Motions and specific force of a wide elliptical swing with a side pull, in the world frame."""
    motions = [pendulum.start_motion(0.37, -0.1, 0.05, 0.2)]
    for _ in range(STEPS):
        motions.append(pendulum.runge_kutta_step(world_rate, 0.0, motions[-1], STEP_S))
    track = np.array(motions)
    accelerations = np.array([world_rate(0.0, motion)[1] for motion in track])
    force = pendulum.specific_force_m_s2(track, accelerations, np.zeros(3), GRAVITY_M_S2, POSITION_M)
    return track, force / GRAVITY_M_S2


def in_housing(motion: NDArray[np.float64]) -> NDArray[np.complex128]:
    """q, w, p of a motion, shape (3, 1)."""
    axes = pendulum.housing_axes(motion)
    gravity = axes @ [0.0, 0.0, -1.0]
    return state_of(gravity, axes @ motion[1], axes @ PULL_M_S2 / GRAVITY_M_S2)


def state_of(
    gravity: NDArray[np.float64], rate: NDArray[np.float64], pull: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """q, w, p of vectors in the housing's axes, shape (3, 1): the pull by the least rotation of gravity to straight down."""
    axis = np.cross(gravity, [0.0, 0.0, -1.0])
    turn = Rotation.from_rotvec(axis / max(np.linalg.norm(axis), 1e-300) * np.arccos(-gravity[2]))
    assert turn.apply(gravity) == pytest.approx([0.0, 0.0, -1.0], abs=1e-8)
    vectors = [2 * gravity / (1 - gravity[2]), rate, turn.apply(pull)]
    return np.array([[v[0] + 1j * v[1]] for v in vectors])


FIELD = ForceField(GRAVITY_M_S2 / LENGTH_M, DAMPING_1_S)


@pytest.mark.slow
def test_housing_frame_agrees_with_the_world_frame(world: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
    motions, force_g = world

    trajectory = integrate(in_housing(motions[0]), FIELD, STEP_S, STEPS)

    modelled_g = specific_force_g(trajectory.state, FIELD, SensorPlacement(POSITION_M / GRAVITY_M_S2))[..., 0]
    assert np.abs(modelled_g - force_g).max() < 2e-8
    assert trajectory.state[-1] == pytest.approx(in_housing(motions[-1]), abs=1e-7)


def test_error_of_steps_and_interpolation_is_far_below_any_noise(
    world: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    motions, force_g = world
    step_s = 2 * np.pi * np.sqrt(LENGTH_M / GRAVITY_M_S2) / 36
    steps = int(STEPS * STEP_S / step_s) + 1
    trajectory = integrate(in_housing(motions[0])[:, None], FIELD, step_s, steps)
    position = np.arange(STEPS) * STEP_S / step_s
    step = position.astype(np.intp)

    states = interpolate(trajectory, step, position - step, np.zeros_like(step))

    modelled_g = specific_force_g(states, FIELD, SensorPlacement(POSITION_M / GRAVITY_M_S2))[..., 0]
    assert np.abs(modelled_g - force_g[:-1]).max() < 3e-5


def test_quadratic_drag_dissipates_the_expected_energy() -> None:
    """Per swing of amplitude A a drag q |w| w takes 8/3 q A of the energy: A falls by 4/3 q A^2."""
    stiffness, drag, amplitude = 1.0, 0.05, 0.1
    state = np.array([[amplitude + 0j], [0j], [0j]])

    trajectory = integrate(state, ForceField(stiffness, 0.0, drag, 0.0), 2 * np.pi / 200, 200)

    assert abs(trajectory.state[-1, 0, 0]) == pytest.approx(amplitude * (1 - 8 / 3 * drag * amplitude), rel=2e-4)


def test_a_spinning_housing_reads_the_same_motion_rotated() -> None:
    state = np.array([[0.2 + 0.05j], [0.03j], [0.01 + 0.02j]])
    still = integrate(state, ForceField(1.0, 0.01), 0.1, 100)
    spinning = integrate(state, ForceField(1.0, 0.01, 0.0, 0.07), 0.1, 100)

    turn = np.exp(-0.07j * 10.0)
    assert spinning.state[-1] == pytest.approx(turn * still.state[-1], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_kinematics_are_those_of_a_rotation_integrated_exactly_up_to_far_beyond_90_degrees(seed: int) -> None:
    """Without forces: a rate constant in the housing's axes turns gravity and pull by one rotation, and damping is left out."""
    rng = np.random.default_rng(seed)
    gravity, azimuth = np.array([np.sin(0.3), 0.0, -np.cos(0.3)]), rng.uniform(0, 2 * np.pi)
    pull = np.cross(gravity, rng.normal(size=3))
    rate = 0.9 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    to_the_housing = np.array([rate[1], -rate[0], 0.0])  # omega x n = rate, n = -z
    steps, step_s = 400, 0.006

    trajectory = integrate(state_of(gravity, rate, pull), ForceField(0.0, 0.0), step_s, steps)

    turned = [Rotation.from_rotvec(-i * step_s * to_the_housing) for i in range(steps + 1)]
    expected = np.array([state_of(turn.apply(gravity), rate, turn.apply(pull)) for turn in turned])
    assert rope_angle(trajectory.state[:, 0]).max() > np.radians(105)
    assert trajectory.state == pytest.approx(expected, abs=1e-8)


@pytest.mark.slow
def test_a_pendulum_conserves_energy_up_to_150_degrees_and_takes_its_period() -> None:
    amplitude_rad, steps = np.radians(150.0), 1000
    state = np.array([[2 * np.tan(amplitude_rad / 2) + 0j], [0j], [0j]])

    trajectory = integrate(state, ForceField(1.0, 0.0), 2 * np.pi * period_ratio(amplitude_rad) / steps, steps)

    q, w = trajectory.state[:, 0, 0], trajectory.state[:, 1, 0]
    energy = np.abs(w) ** 2 / 2 - np.cos(rope_angle(q))
    assert energy == pytest.approx(energy[0], abs=1e-8)
    assert trajectory.state[-1] == pytest.approx(state, abs=1e-6)


def test_a_pendulum_rests_along_gravity_and_pull() -> None:
    pull = np.array([0.4 - 0.3j])
    rest = np.stack([equilibrium(pull), 0 * pull, pull])

    assert rope_angle(rest[0]) == pytest.approx(np.arctan(0.5))
    assert integrate(rest, ForceField(1.0, 0.0), 0.1, 50).state[-1] == pytest.approx(rest, abs=1e-12)
