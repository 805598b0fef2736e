"""States of the rope model for its tests, and their course by its equations."""

import numpy as np
import pytest

from devices.pendulum import pendulum
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.rope_model import RopeModel
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
