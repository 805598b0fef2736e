"""The filter's equations of motion against their derivatives, the swing fit's equations and the world-frame pendulum."""

from collections.abc import Callable

import numpy as np
import pytest

from devices.pendulum import equations, pendulum
from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.initial_state import Constants
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import LONGEST_SHARE, RopeModel
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    GUST,
    HEAVE,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    LEVER,
    LINE,
    LN_LENGTH,
    MOUNT,
    N_MOVING,
    N_STATES,
    OFFSET,
    PIVOT,
    PIVOT_RATE,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
    STIFFNESS,
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
LENGTH_M = 12.0
SEEDS = range(20)
TURNING = (GRAVITY, RATE, PIVOT, PIVOT_RATE, GUST, SIDE_FORCE, PIVOT_VELOCITY)
SENSOR = (OFFSET, MOUNT, AXIAL_OFFSET, LINE)

both_mountings = pytest.mark.parametrize("is_clamped", [True, False], ids=["clamped", "fixed"])
all_models = pytest.mark.parametrize(
    "model",
    [
        RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True),
        RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=False),
        RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True, on_spreader=True),
    ],
    ids=["clamped", "fixed", "spreader"],
)


def clamped() -> RopeModel:
    return RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True)


def on_spreader() -> RopeModel:
    return RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True, on_spreader=True)


def random_states(rng: np.random.Generator, model: RopeModel) -> Array:
    """A state for each hypothesis in which nothing is zero."""
    x = np.zeros((N_HYPOTHESES, N_STATES))
    for place, size in (
        (GRAVITY, 0.2),
        (RATE, 0.2),
        (PIVOT, 0.03),
        (PIVOT_RATE, 0.02),
        (GUST, 0.02),
        (SIDE_FORCE, 0.01),
        (OFFSET, 0.01),
        (MOUNT, 0.02),
        (AXIAL_OFFSET, 0.01),
        (HOIST_SPEED, 0.5),
        (HOIST_ACCELERATION, 0.2),
        (PIVOT_VELOCITY, 1.0),
        (LEVER, 0.05),
        (STIFFNESS, 0.05),
        (HEAVE, 0.01),
        (LINE, 0.02),
        (SPIN, 0.1),
    ):
        x[:, place] = size * rng.normal(size=x[:, place].shape)
    length_m = rng.uniform(3, 40, N_HYPOTHESES)
    tilt, distance_m = rng.uniform(0.05, 0.3, N_HYPOTHESES), rng.uniform(0.05, 0.95, N_HYPOTHESES) * length_m
    x[:, LN_LENGTH], x[:, PLACE] = np.log(length_m), tilt if model.on_spreader else distance_m
    x[:, DAMPING] = rng.uniform(0, 0.1, N_HYPOTHESES)
    return x


def without(x: Array, *states: slice | int) -> Array:
    """Return states with zero for some of them."""
    found = x.copy()
    for each in states:
        found[:, each] = 0.0
    return found


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

    def rate(_time_s: float, moved: Array) -> Array:
        found = np.zeros_like(moved)
        found[:, :N_MOVING] = model.rate(moved)[0]
        return found

    states = [x]
    for step in range(steps):
        states.append(pendulum.runge_kutta_step(rate, step * step_s, states[-1], step_s))
    return np.array(states)


def direction(u: complex) -> complex:
    """The direction of gravity as the swing's fit describes it."""
    return u * 2 / (1 + float(np.sqrt(1 - abs(u) ** 2)))


@all_models
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_rate_is_that_of_central_differences(seed: int, model: RopeModel) -> None:
    x = random_states(np.random.default_rng(seed), model)

    _, jacobian = model.rate(x)

    expected = central_differences(lambda moved: model.rate(moved)[0], x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-7, rtol=1e-6)


@all_models
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_reading_is_that_of_central_differences(seed: int, model: RopeModel) -> None:
    x = random_states(np.random.default_rng(seed), model)
    if not model.on_spreader:
        x[:, LEVER] = 0.0  # what a lever of centimetres adds to the derivative by constants is left out

    _, jacobian, _ = model.reading(x)

    expected = central_differences(lambda moved: model.reading(moved)[0], x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-7, rtol=1e-6)


@both_mountings
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_reading_beside_the_rope_by_the_motion_is_that_of_central_differences(
    seed: int, is_clamped: bool
) -> None:
    model = RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=is_clamped)
    x = random_states(np.random.default_rng(seed), model)

    _, jacobian, _ = model.reading(x)

    expected = central_differences(lambda moved: model.reading(moved)[0], x)
    for states in (GRAVITY, RATE, PIVOT, GUST, SIDE_FORCE, HEAVE, HOIST_ACCELERATION, PLACE, LEVER, MOUNT):
        np.testing.assert_allclose(jacobian[:, :, states], expected[:, :, states], atol=1e-7, rtol=1e-6)


@both_mountings
def test_free_swing_is_that_of_the_swing_fit(is_clamped: bool) -> None:
    length_m, above_m, damping_1_s, step_s, steps = 14.0, 5.0, 0.02, 0.02, 600
    u, w = 0.3 - 0.1j, 0.05 + 0.15j
    model = RopeModel(GRAVITY_M_S2, length_m, is_clamped=is_clamped)
    x = plain_state(u, w, length_m, above_m if is_clamped else length_m - above_m, damping_1_s)

    states = integrate_states(model, x, step_s, steps)[:, 0]

    field = ForceField(GRAVITY_M_S2 / length_m, damping_1_s)
    fitted = integrate(np.array([[direction(u)], [w], [0j]]), field, step_s, steps).state
    np.testing.assert_allclose(states[:, 0] + 1j * states[:, 1], gravity_components(fitted[:, 0, 0])[0], atol=1e-9)
    np.testing.assert_allclose(states[:, 2] + 1j * states[:, 3], fitted[:, 1, 0], atol=1e-9)
    placement = SensorPlacement((length_m - above_m) / GRAVITY_M_S2)
    readings = np.array([model.reading(np.tile(state, (N_HYPOTHESES, 1)))[0][0] for state in states])
    np.testing.assert_allclose(readings, specific_force_g(fitted, field, placement)[..., 0], atol=1e-9)


def test_swing_on_a_changing_rope_is_that_of_the_swing_fit() -> None:
    length_m, above_m, speed_m_s, acceleration_m_s2, step_s, steps = 14.0, 5.0, 0.3, -0.02, 0.02, 500
    u, w = 0.2 + 0.1j, -0.1 + 0.05j
    model = clamped()
    x = plain_state(u, w, length_m, above_m)
    x[:, HOIST_SPEED], x[:, HOIST_ACCELERATION] = speed_m_s, acceleration_m_s2

    states = integrate_states(model, x, step_s, steps)[:, 0]

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
    readings = np.array([model.reading(np.tile(state, (N_HYPOTHESES, 1)))[0][0] for state in states])
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
    x[:, PIVOT] = (axes @ pivot_m_s2)[:2] / GRAVITY_M_S2
    x[:, HOIST_SPEED], x[:, HOIST_ACCELERATION] = speed_m_s, acceleration_m_s2
    model = clamped()

    reading, _, _ = model.reading(x)
    state_rate, _ = model.rate(x)

    np.testing.assert_allclose(reading[0], force_m_s2 / GRAVITY_M_S2, atol=1e-12)
    np.testing.assert_allclose(state_rate[0, RATE], (axes @ n_acceleration)[:2], atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_transverse_reading_is_the_angular_acceleration_and_the_force_on_the_load(seed: int) -> None:
    """Whatever the pivot and the hoist do: -(L - r) w'/g + F."""
    x = without(random_states(np.random.default_rng(seed), clamped()), *SENSOR, SPIN, DAMPING, STIFFNESS)
    model = clamped()

    reading, _, _ = model.reading(x)
    rate, _ = model.rate(x)

    expected = x[:, GUST] + x[:, SIDE_FORCE] - x[:, PLACE, None] * rate[:, RATE] / GRAVITY_M_S2
    np.testing.assert_allclose(reading[:, :2], expected, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_accelerometer_beside_the_rope_feels_its_lever_arm_turn(seed: int) -> None:
    """Along the rope as in the world's frame; what a lever of centimetres adds across the rope is left out."""
    rng = np.random.default_rng(seed)
    motion, length_m, lever_m = (
        pendulum.start_motion(*rng.normal(0, 0.2, 4)),
        rng.uniform(6, 30),
        rng.normal(0, 0.05, 2),
    )
    n, n_rate, x_axis = motion
    n_acceleration = pendulum.acceleration_of_direction(n, n_rate, np.array([0.0, 0.0, -GRAVITY_M_S2]), length_m, 0.0)
    added_m_s2 = equations.lever_arm_acceleration(
        tuple(n), tuple(n_rate), tuple(n_acceleration), tuple(x_axis), (lever_m[0], 0.0, 0.0), (lever_m[1], 0.0, 0.0)
    )
    axes = pendulum.housing_axes(motion)
    down, rate = axes @ [0.0, 0.0, -1.0], axes @ n_rate
    x = plain_state(complex(*down[:2]), complex(*rate[:2]), length_m, 0.4 * length_m)
    beside = x.copy()
    beside[:, LEVER] = lever_m

    added = clamped().reading(beside)[0][0] - clamped().reading(x)[0][0]

    np.testing.assert_allclose(added[2], -np.dot(added_m_s2, n) / GRAVITY_M_S2, atol=1e-12)
    np.testing.assert_allclose(added[:2], 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("stiffness", "azimuth_rad"), [((0.1, 0.0), 0.0), ((0.1, 0.0), np.pi / 2), ((0.0, 0.1), np.pi / 4)]
)
def test_rope_that_is_stiffer_in_one_plane_swings_faster_in_it(
    stiffness: tuple[float, float], azimuth_rad: float
) -> None:
    """Along x a tenth more, along y a tenth less, and the same along the diagonals."""
    along = np.exp(1j * azimuth_rad)
    x = plain_state(0.001 * along, 0j, LENGTH_M, 4.0)
    x[:, STIFFNESS] = stiffness
    sign = -1 if azimuth_rad == np.pi / 2 else 1

    states = integrate_states(clamped(), x, 0.02, 500)[:, 0]

    rate_1_s = np.sqrt((1 + sign * 0.1) * GRAVITY_M_S2 / LENGTH_M)
    expected = 0.001 * along * np.cos(rate_1_s * 0.02 * np.arange(501))
    np.testing.assert_allclose(states[:, 0] + 1j * states[:, 1], expected, atol=1e-8)


@all_models
def test_pivot_that_moves_up_and_down_adds_its_acceleration_to_the_axial_reading(model: RopeModel) -> None:
    x = plain_state(0j, 0j, LENGTH_M, 0.2)
    x[:, HEAVE] = np.linspace(-0.02, 0.02, N_HYPOTHESES)

    reading, _, _ = model.reading(x)

    np.testing.assert_allclose(reading[:, 2], 1 + x[:, HEAVE], atol=1e-15)
    np.testing.assert_allclose(reading[:, :2], 0.0, atol=1e-15)


@pytest.mark.parametrize("seed", SEEDS)
def test_reading_on_a_spreader_has_the_direction_of_the_ropes_whatever_moves_the_pivot(seed: int) -> None:
    """Without a wind the ropes' force alone acts on the spreader; it tilts against them in a fixed ratio to their angle."""
    model = on_spreader()
    x = without(random_states(np.random.default_rng(seed), model), *SENSOR, GUST, SIDE_FORCE)
    moved = x.copy()
    moved[:, PIVOT], moved[:, HEAVE], moved[:, HOIST_ACCELERATION] = -2 * x[:, PIVOT], 0.02, 0.4

    reading, after = model.reading(x)[0], model.reading(moved)[0]

    assert np.abs(after[:, 2] - reading[:, 2]).max() > 0.01
    np.testing.assert_allclose(after[:, :2] / after[:, 2:], reading[:, :2] / reading[:, 2:], atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_reading_on_a_level_spreader_is_the_force_in_the_world_frame(seed: int) -> None:
    """A spreader that stays level reads the acceleration of the load plus gravity, to second order in the angle."""
    rng = np.random.default_rng(seed)
    motion = pendulum.start_motion(*rng.normal(0, 0.02, 4))
    pivot_m_s2, wind_m_s2 = np.array([*rng.normal(0, 0.3, 2), 0.0]), np.array([*rng.normal(0, 0.1, 2), 0.0])
    length_m, speed_m_s, acceleration_m_s2 = rng.uniform(6, 30), rng.normal(0, 0.5), rng.normal(0, 0.2)
    drive_m_s2 = np.array([0.0, 0.0, -GRAVITY_M_S2]) - pivot_m_s2 + wind_m_s2
    n, n_rate = motion[:2]
    n_acceleration = pendulum.acceleration_of_direction(n, n_rate, drive_m_s2, length_m, speed_m_s)
    load_m_s2 = pivot_m_s2 + length_m * n_acceleration + 2 * speed_m_s * n_rate + acceleration_m_s2 * n
    axes = pendulum.housing_axes(motion)
    down, rate = axes @ [0.0, 0.0, -1.0], axes @ n_rate
    x = plain_state(complex(*down[:2]), complex(*rate[:2]), length_m, 0.0)
    x[:, PIVOT], x[:, GUST] = (axes @ pivot_m_s2)[:2] / GRAVITY_M_S2, (axes @ wind_m_s2)[:2] / GRAVITY_M_S2
    x[:, HOIST_SPEED], x[:, HOIST_ACCELERATION] = speed_m_s, acceleration_m_s2

    reading, _, _ = on_spreader().reading(x)

    largest = float(np.hypot(*down[:2]))
    acting = float(np.linalg.norm(pivot_m_s2) + np.linalg.norm(wind_m_s2)) / GRAVITY_M_S2
    expected = load_m_s2 / GRAVITY_M_S2 + [0.0, 0.0, 1.0]
    np.testing.assert_allclose(reading[0, :2], expected[:2], atol=2 * largest**2 * (largest + acting))
    np.testing.assert_allclose(reading[0, 2], expected[2], atol=2 * largest * acting + largest**4)


def test_undamped_free_swing_keeps_its_energy() -> None:
    length_m = 12.0
    x = plain_state(0.4 + 0.1j, -0.1 + 0.2j, length_m, 4.0)

    states = integrate_states(clamped(), x, 0.02, 1500)[:, 0]

    u, w = states[:, GRAVITY], states[:, RATE]
    height = 1 - np.sqrt(1 - (u * u).sum(axis=1))
    energy = (w * w).sum(axis=1) / 2 + GRAVITY_M_S2 / length_m * height
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_spin_turns_every_pair_that_keeps_its_direction_in_the_world(seed: int) -> None:
    """The equations are the same in a housing that is turned: a turning one adds the turn alone."""
    x = random_states(np.random.default_rng(seed), clamped())
    model = clamped()
    still = x.copy()
    still[:, SPIN] = 0.0

    turned_by = model.rate(x)[0] - model.rate(still)[0]

    expected = np.zeros_like(turned_by)
    for pair in TURNING:
        expected[:, pair] = x[:, SPIN, None] * np.column_stack([x[:, pair.start + 1], -x[:, pair.start]])
    expected[:, SPIN] = turned_by[:, SPIN]
    np.testing.assert_allclose(turned_by, expected, atol=1e-14)
    assert (turned_by[:, SPIN] * x[:, SPIN] <= 0).all()


def test_readings_in_a_turned_housing_are_turned() -> None:
    x = random_states(np.random.default_rng(1), clamped())
    model = clamped()
    turn = np.exp(0.7j)
    turned = x.copy()
    pairs = [(pair, turn) for pair in (*TURNING, OFFSET, MOUNT, LEVER, LINE)]
    for pair, by in (*pairs, (STIFFNESS, turn**2)):  # a symmetric matrix without trace turns twice as fast
        rotated = (x[:, pair.start] + 1j * x[:, pair.start + 1]) * by
        turned[:, pair] = np.column_stack([rotated.real, rotated.imag])

    reading, after = model.reading(x)[0], model.reading(turned)[0]

    rotated = (reading[:, 0] + 1j * reading[:, 1]) * turn
    np.testing.assert_allclose(after, np.column_stack([rotated.real, rotated.imag, reading[:, 2]]), atol=1e-14)


@all_models
def test_constants_of_a_gyroscope_change_no_force(model: RopeModel) -> None:
    wider = RopeModel(
        GRAVITY_M_S2, LENGTH_M, is_clamped=model.is_clamped, on_spreader=model.on_spreader, n_states=N_STATES + 5
    )
    rng = np.random.default_rng(3)
    x = random_states(rng, model)
    with_gyro = np.hstack([x, rng.normal(size=(N_HYPOTHESES, 5))])

    for found, expected in ((wider.rate(with_gyro), model.rate(x)), (wider.reading(with_gyro), model.reading(x))):
        np.testing.assert_array_equal(found[0], expected[0])
        np.testing.assert_array_equal(found[1][..., :N_STATES], expected[1])
        assert not found[1][..., N_STATES:].any()


def test_prediction_of_the_filter_follows_the_equations_from_bin_to_bin() -> None:
    """Prediction alone, without a reading."""
    length_m, bin_s = 9.0, 0.1
    model = clamped()
    motion_filter = MotionFilter(model, Constants(length_m, 0.05, 4.0, 0.05, (3e-4, 3e-4, 3e-4), 1e-3))
    mixture = motion_filter.mixture
    x = plain_state(0.15 + 0.02j, 0.03 - 0.05j, length_m, 4.0, mixture.state[0, DAMPING])
    exact = integrate_states(model, x, bin_s / 10, 10)[-1, 0]
    mixture.state[:] = x

    motion_filter.predict(bin_s)

    np.testing.assert_allclose(motion_filter.mixture.state[0, :4], exact[:4], atol=2e-6)


def test_states_beyond_the_domain_are_limited_to_it() -> None:
    x = plain_state(1.5 + 0.5j, 0j, 9.0, 4.0)
    x[0, LN_LENGTH], x[1, LN_LENGTH] = 50.0, -50.0
    model = clamped()

    model.keep_in_domain(x)

    assert (np.hypot(x[:, 0], x[:, 1]) < 1).all()
    assert np.isfinite(model.rate(x)[0]).all()
    assert np.isfinite(model.reading(x)[0]).all()
    np.testing.assert_allclose(x[:, 1] / x[:, 0], 1 / 3)
    np.testing.assert_allclose(np.exp(x[:3, LN_LENGTH]), [LONGEST_SHARE * LENGTH_M, LENGTH_M / LONGEST_SHARE, 9.0])
