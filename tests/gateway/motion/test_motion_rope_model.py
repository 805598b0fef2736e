"""The filter's equations of motion against the swing fit's equations and the world-frame pendulum."""

import numpy as np
import pytest

from devices.pendulum import equations, pendulum
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.rope_model import SHORTEST_PER_PLACE, RopeModel
from gateway.motion.state_vector import (
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
    N_STATES,
    OFFSET,
    PIVOT,
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
from tests.gateway.motion.rope_states import (
    GRAVITY_M_S2,
    LENGTH_M,
    SEEDS,
    SENSOR,
    TURNING,
    all_models,
    both_mountings,
    clamped,
    integrate_states,
    plain_state,
    random_states,
    without,
)


def direction(u: complex) -> complex:
    """The direction of gravity as the swing's fit describes it."""
    return u * 2 / (1 + float(np.sqrt(1 - abs(u) ** 2)))


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


def test_no_rope_is_much_shorter_than_the_distance_of_its_housing_from_the_load() -> None:
    x = np.zeros((N_HYPOTHESES, N_STATES))
    x[:, PLACE], x[:, LN_LENGTH] = 7.5, np.log(LENGTH_M / 3)

    RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True).keep_in_domain(x)

    np.testing.assert_allclose(np.exp(x[:, LN_LENGTH]), SHORTEST_PER_PLACE * 7.5)
