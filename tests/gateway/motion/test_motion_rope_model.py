"""The filter's equations of motion against their derivatives, the swing fit's equations and the world-frame pendulum."""

from collections.abc import Callable

import numpy as np
import pytest

from devices.pendulum import pendulum
from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from gateway.motion.hypotheses import N_HYPOTHESES, MotionHypothesis
from gateway.motion.initial_state import Constants
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    LINE,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    OFFSET,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
)
from gateway.numerics.array import Array
from gateway.swing.model.spherical_pendulum import (
    ForceField,
    SensorPlacement,
    TrajectoryInput,
    gravity_components,
    integrate,
    specific_force_g,
)

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2
FREE, DRIVEN, DRIVEN_HOISTING = MotionHypothesis.FREE, MotionHypothesis.DRIVEN, MotionHypothesis.DRIVEN_HOISTING
SEEDS = range(20)
TURNING = (GRAVITY, RATE, INPUT, INPUT_RATE, SIDE_FORCE, PIVOT_VELOCITY)

both_mountings = pytest.mark.parametrize("is_clamped", [True, False], ids=["clamped", "fixed"])


def random_states(rng: np.random.Generator) -> Array:
    """A state for each hypothesis in which nothing is zero."""
    x = np.zeros((N_HYPOTHESES, N_STATES))
    for place, size in (
        (GRAVITY, 0.2),
        (RATE, 0.2),
        (INPUT, 0.03),
        (INPUT_RATE, 0.02),
        (SIDE_FORCE, 0.01),
        (OFFSET, 0.01),
        (MOUNT, 0.02),
        (AXIAL_OFFSET, 0.01),
        (HOIST_SPEED, 0.5),
        (HOIST_ACCELERATION, 0.2),
        (PIVOT_VELOCITY, 1.0),
        (LINE, 0.02),
        (SPIN, 0.1),
    ):
        x[:, place] = size * rng.normal(size=x[:, place].shape)
    length_m = rng.uniform(3, 40, N_HYPOTHESES)
    x[:, LN_LENGTH], x[:, PLACE] = np.log(length_m), rng.uniform(0.05, 0.95, N_HYPOTHESES) * length_m
    x[:, DAMPING] = rng.uniform(0, 0.1, N_HYPOTHESES)
    return x


def central_differences(function: Callable[[Array], Array], x: Array) -> Array:
    """The derivative of rows by the states of the same row, shape (m, values, N_STATES)."""
    columns = []
    for state in range(N_STATES):
        step = np.zeros(N_STATES)
        step[state] = 1e-5
        columns.append((function(x + step) - function(x - step)) / 2e-5)
    return np.stack(columns, axis=-1)


def plain_state(u: complex, w: complex, length_m: float, place_m: float, damping_1_s: float = 0.0) -> Array:
    """The same motion under each hypothesis, without anything that acts."""
    x = np.zeros((N_HYPOTHESES, N_STATES))
    x[:, GRAVITY], x[:, RATE] = (u.real, u.imag), (w.real, w.imag)
    x[:, LN_LENGTH], x[:, PLACE], x[:, DAMPING] = np.log(length_m), place_m, damping_1_s
    return x


def integrate_states(model: RopeModel, x: Array, step_s: float, steps: int) -> Array:
    """States by classical Runge-Kutta steps, shape (steps + 1, m, N_STATES)."""
    states = [x]
    for step in range(steps):
        states.append(
            pendulum.runge_kutta_step(lambda _time_s, moved: model.rate(moved)[0], step * step_s, states[-1], step_s)
        )
    return np.array(states)


def direction(u: complex) -> complex:
    """The direction of gravity as the swing's fit describes it."""
    return u * 2 / (1 + float(np.sqrt(1 - abs(u) ** 2)))


@both_mountings
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_rate_is_that_of_central_differences(seed: int, is_clamped: bool) -> None:
    model = RopeModel(GRAVITY_M_S2, is_clamped)
    x = random_states(np.random.default_rng(seed))

    _, jacobian = model.rate(x)

    expected = central_differences(lambda moved: model.rate(moved)[0], x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-7, rtol=1e-6)


@both_mountings
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_reading_is_that_of_central_differences(seed: int, is_clamped: bool) -> None:
    model = RopeModel(GRAVITY_M_S2, is_clamped)
    x = random_states(np.random.default_rng(seed))
    x[:, LINE] = 0.0  # a fast oscillation is not taken as a measure of length and place

    _, jacobian, _ = model.reading(x)

    expected = central_differences(lambda moved: model.reading(moved)[0], x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-7, rtol=1e-6)


@both_mountings
def test_free_swing_is_that_of_the_swing_fit(is_clamped: bool) -> None:
    length_m, above_m, damping_1_s, step_s, steps = 14.0, 5.0, 0.02, 0.02, 600
    u, w = 0.3 - 0.1j, 0.05 + 0.15j
    model = RopeModel(GRAVITY_M_S2, is_clamped)
    x = plain_state(u, w, length_m, above_m if is_clamped else length_m - above_m, damping_1_s)

    states = integrate_states(model, x, step_s, steps)[:, FREE]

    field = ForceField(GRAVITY_M_S2 / length_m, damping_1_s)
    fitted = integrate(np.array([[direction(u)], [w], [0j]]), field, step_s, steps).state
    np.testing.assert_allclose(states[:, 0] + 1j * states[:, 1], gravity_components(fitted[:, 0, 0])[0], atol=1e-9)
    np.testing.assert_allclose(states[:, 2] + 1j * states[:, 3], fitted[:, 1, 0], atol=1e-9)
    placement = SensorPlacement((length_m - above_m) / GRAVITY_M_S2)
    readings = np.array([model.reading(np.tile(state, (N_HYPOTHESES, 1)))[0][FREE] for state in states])
    np.testing.assert_allclose(readings, specific_force_g(fitted, field, placement)[..., 0], atol=1e-9)


def test_swing_on_a_changing_rope_is_that_of_the_swing_fit() -> None:
    length_m, above_m, speed_m_s, acceleration_m_s2, step_s, steps = 14.0, 5.0, 0.3, -0.02, 0.02, 500
    u, w = 0.2 + 0.1j, -0.1 + 0.05j
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)
    x = plain_state(u, w, length_m, above_m)
    x[:, HOIST_SPEED], x[:, HOIST_ACCELERATION] = speed_m_s, acceleration_m_s2

    states = integrate_states(model, x, step_s, steps)[:, MotionHypothesis.FREE_HOISTING]

    half_s: Array = step_s / 2 * np.arange(2 * steps + 1, dtype=np.float64)
    lengths_m: Array = length_m + half_s * (speed_m_s + acceleration_m_s2 / 2 * half_s)
    speeds_m_s: Array = speed_m_s + acceleration_m_s2 * half_s
    hoist = TrajectoryInput(GRAVITY_M_S2 / lengths_m, 0.0, speeds_m_s / lengths_m)
    fitted = integrate(np.array([direction(u), w, 0j]), hoist, step_s, steps).state
    np.testing.assert_allclose(np.exp(states[:, LN_LENGTH]), lengths_m[::2], atol=1e-8)
    np.testing.assert_allclose(states[:, 0] + 1j * states[:, 1], gravity_components(fitted[:, 0])[0], atol=1e-9)
    field = ForceField(hoist.stiffness_1_s2[::2], 0.0, lengthening_1_s=hoist.lengthening_1_s[::2])
    placement = SensorPlacement(
        (lengths_m[::2] - above_m) / GRAVITY_M_S2, speeds_m_s[::2] / GRAVITY_M_S2, acceleration_m_s2 / GRAVITY_M_S2
    )
    readings = np.array([model.reading(np.tile(state, (N_HYPOTHESES, 1)))[0][FREE] for state in states])
    np.testing.assert_allclose(readings, specific_force_g(fitted, field, placement), atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_reading_and_acceleration_are_those_of_the_world_frame_while_the_pivot_moves(seed: int) -> None:
    """Any horizontal acceleration of the pivot, any hoist, any swing: the housing's axes see the same forces."""
    rng = np.random.default_rng(seed)
    motion = pendulum.start_motion(*rng.normal(0, 0.2, 4))
    pivot_m_s2 = np.array([*rng.normal(0, 0.5, 2), 0.0])
    length_m, above_m = rng.uniform(6, 30), rng.uniform(0.5, 5)
    speed_m_s, acceleration_m_s2 = rng.normal(0, 0.5), rng.normal(0, 0.2)
    n_acceleration = pendulum.acceleration_of_direction(
        motion[0], motion[1], np.array([0.0, 0.0, -GRAVITY_M_S2]) - pivot_m_s2, length_m, speed_m_s
    )
    force_m_s2 = pendulum.specific_force_m_s2(
        motion,
        n_acceleration,
        pivot_m_s2,
        GRAVITY_M_S2,
        length_m - above_m,
        speed_m_s,
        acceleration_m_s2,
    )
    axes = pendulum.housing_axes(motion)
    down, rate = axes @ [0.0, 0.0, -1.0], axes @ motion[1]
    x = plain_state(complex(*down[:2]), complex(*rate[:2]), length_m, above_m)
    x[:, INPUT] = (axes @ pivot_m_s2)[:2] / GRAVITY_M_S2
    x[:, HOIST_SPEED], x[:, HOIST_ACCELERATION] = speed_m_s, acceleration_m_s2
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)

    reading, _, _ = model.reading(x)
    state_rate, _ = model.rate(x)

    for hypothesis in (DRIVEN, DRIVEN_HOISTING):
        np.testing.assert_allclose(reading[hypothesis], force_m_s2 / GRAVITY_M_S2, atol=1e-12)
        np.testing.assert_allclose(state_rate[hypothesis, RATE], (axes @ n_acceleration)[:2], atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_transverse_reading_is_the_angular_acceleration_whatever_the_pivot_and_the_hoist_do(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = random_states(rng)
    x[:, SIDE_FORCE], x[:, OFFSET], x[:, MOUNT], x[:, LINE], x[:, SPIN], x[:, DAMPING] = 0, 0, 0, 0, 0, 0
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)

    reading, _, _ = model.reading(x)
    rate, _ = model.rate(x)

    for hypothesis in (FREE, DRIVEN, MotionHypothesis.FREE_HOISTING, DRIVEN_HOISTING):
        expected = -x[hypothesis, PLACE] * rate[hypothesis, RATE] / GRAVITY_M_S2
        np.testing.assert_allclose(reading[hypothesis, :2], expected, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_gust_adds_its_force_to_the_transverse_reading(seed: int) -> None:
    x = random_states(np.random.default_rng(seed))
    x[:, OFFSET], x[:, MOUNT], x[:, LINE], x[:, SPIN], x[:, DAMPING] = 0, 0, 0, 0, 0
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)

    reading, _, _ = model.reading(x)
    rate, _ = model.rate(x)

    gusts = [MotionHypothesis.GUST, MotionHypothesis.GUST_HOISTING]
    force = x[gusts, SIDE_FORCE] + x[gusts, INPUT]
    expected = force - x[gusts, PLACE, None] * rate[gusts, RATE] / GRAVITY_M_S2
    np.testing.assert_allclose(reading[gusts, :2], expected, atol=1e-12)


def test_undamped_free_swing_keeps_its_energy() -> None:
    length_m = 12.0
    x = plain_state(0.4 + 0.1j, -0.1 + 0.2j, length_m, 4.0)

    states = integrate_states(RopeModel(GRAVITY_M_S2, is_clamped=True), x, 0.02, 1500)[:, FREE]

    u, w = states[:, GRAVITY], states[:, RATE]
    height = 1 - np.sqrt(1 - (u * u).sum(axis=1))
    energy = (w * w).sum(axis=1) / 2 + GRAVITY_M_S2 / length_m * height
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_spin_turns_every_pair_that_keeps_its_direction_in_the_world(seed: int) -> None:
    """The equations are the same in a housing that is turned: a turning one adds the turn alone."""
    x = random_states(np.random.default_rng(seed))
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)
    still = x.copy()
    still[:, SPIN] = 0.0

    turned_by = model.rate(x)[0] - model.rate(still)[0]

    expected = np.zeros_like(x)
    for pair in TURNING:
        expected[:, pair] = x[:, SPIN, None] * np.column_stack([x[:, pair.start + 1], -x[:, pair.start]])
    expected[:, SPIN] = turned_by[:, SPIN]
    np.testing.assert_allclose(turned_by, expected, atol=1e-14)
    assert (turned_by[:, SPIN] * x[:, SPIN] <= 0).all()


def test_readings_in_a_turned_housing_are_turned() -> None:
    x = random_states(np.random.default_rng(1))
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)
    turn = np.exp(0.7j)
    turned = x.copy()
    for pair in (*TURNING, OFFSET, MOUNT, LINE):
        rotated = (x[:, pair.start] + 1j * x[:, pair.start + 1]) * turn
        turned[:, pair] = np.column_stack([rotated.real, rotated.imag])

    reading, after = model.reading(x)[0], model.reading(turned)[0]

    rotated = (reading[:, 0] + 1j * reading[:, 1]) * turn
    np.testing.assert_allclose(after, np.column_stack([rotated.real, rotated.imag, reading[:, 2]]), atol=1e-14)


def test_prediction_of_the_filter_follows_the_equations_from_bin_to_bin() -> None:
    """Prediction alone, without a reading."""
    length_m, bin_s = 9.0, 0.1
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)
    motion_filter = MotionFilter(model, Constants(length_m, 0.05, 4.0, 0.05, (3e-4, 3e-4, 3e-4), 1e-3))
    mixture = motion_filter.mixture
    x = plain_state(0.15 + 0.02j, 0.03 - 0.05j, length_m, 4.0, mixture.state[0, DAMPING])
    exact = integrate_states(model, x, bin_s / 10, 10)[-1, FREE]
    mixture.state[:] = x

    motion_filter.predict(bin_s)

    np.testing.assert_allclose(motion_filter.mixture.state[FREE, :4], exact[:4], atol=2e-6)


def test_states_beyond_the_domain_are_limited_to_it() -> None:
    x = plain_state(1.5 + 0.5j, 0j, 9.0, 4.0)
    x[0, LN_LENGTH] = 50.0
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)

    model.keep_in_domain(x)

    assert (np.hypot(x[:, 0], x[:, 1]) < 1).all()
    assert np.isfinite(model.rate(x)[0]).all()
    assert np.isfinite(model.reading(x)[0]).all()
    np.testing.assert_allclose(x[1:, 1] / x[1:, 0], 1 / 3)
