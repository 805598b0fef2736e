"""The reading of a housing on a spreader against the forces in the world frame."""

import numpy as np
import pytest

from devices.pendulum import pendulum
from gateway.motion.state_vector import (
    GUST,
    HEAVE,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    PIVOT,
    SIDE_FORCE,
)
from tests.gateway.motion.rope_states import (
    GRAVITY_M_S2,
    SEEDS,
    SENSOR,
    on_spreader,
    plain_state,
    random_states,
    without,
)


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
