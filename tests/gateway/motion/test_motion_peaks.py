"""The predicted maximum and the ellipse of a swing against an integrated pendulum."""

import numpy as np
import pytest

from devices.pendulum import pendulum
from devices.pendulum.small_swing import period_ratio
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.peaks import SwingPhase, ellipse, next_peak
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_estimate import Described, swing_phase
from gateway.motion.state_vector import (
    GRAVITY,
    GUST,
    LN_LENGTH,
    N_MOVING,
    N_STATES,
    PIVOT,
    PIVOT_RATE,
    PLACE,
    RATE,
    SIDE_FORCE,
)
from gateway.numerics.array import Array
from tests.gateway.motion.conftest import GRAVITY_M_S2

LENGTH_M, STEP_S = 10.0, 0.02
RATE_1_S = float(np.sqrt(GRAVITY_M_S2 / LENGTH_M))
SWING_S = 2 * np.pi / RATE_1_S


def integrate(mean: Array, duration_s: float) -> tuple[Array, Array]:
    """Time and angle of the motion that begins with this phase and keeps the pivot's acceleration."""
    model = RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True)
    x = np.zeros((N_HYPOTHESES, N_STATES))
    x[:, GRAVITY], x[:, RATE], x[:, SIDE_FORCE], x[:, PIVOT] = mean.reshape(4, 2)
    x[:, LN_LENGTH], x[:, PLACE] = np.log(LENGTH_M), 4.0

    def rate(_time_s: float, states: Array) -> Array:
        found = np.zeros_like(states)
        found[:, :N_MOVING] = model.rate(states)[0]
        found[:, PIVOT] = found[:, PIVOT_RATE] = 0.0
        return found

    states = [x]
    for _ in range(round(duration_s / STEP_S)):
        states.append(pendulum.runge_kutta_step(rate, 0.0, states[-1], STEP_S))
    track = np.array(states)[:, 0, GRAVITY]
    time_s: Array = STEP_S * np.arange(len(track), dtype=np.float64)
    angle_rad: Array = np.arcsin(np.hypot(track[:, 0], track[:, 1]))
    return time_s, angle_rad


def largest(mean: Array) -> tuple[float, float]:
    """The largest angle of the next swing, and its time; of two that differ by less than 5 %, that of the sooner."""
    time_s, angle_rad = integrate(mean, SWING_S * period_ratio(np.hypot(*mean[:2])))
    at = int(angle_rad[: len(angle_rad) // 2].argmax())
    if angle_rad.max() > 1.05 * angle_rad[at]:
        at = int(angle_rad.argmax())
    return float(angle_rad.max()), float(time_s[at])


def phase(
    u: tuple[float, float],
    w: tuple[float, float],
    side: tuple[float, float] = (0.0, 0.0),
    pivot: tuple[float, float] = (0.0, 0.0),
    covariance: Array | None = None,
) -> SwingPhase:
    return SwingPhase(
        np.array([*u, *w, *side, *pivot]), np.zeros((8, 8)) if covariance is None else covariance, RATE_1_S
    )


CASES = {
    "planar": phase((0.1, 0.05), (-0.12, -0.06)),
    "wide": phase((0.2, 0.0), (0.22, 0.0)),
    "elliptical": phase((0.1, 0.0), (0.05, 0.06)),
    "circular": phase((0.1, 0.0), (0.0, 0.1 * RATE_1_S)),
    "lean": phase((0.05, 0.02), (0.1, -0.05), side=(-0.03, 0.02)),
    "lean, just past the near turning point": phase((-0.02, 0.0), (0.005, 0.0), side=(-0.075, 0.0)),
    "lean, just past the far turning point": phase((0.17, 0.0), (-0.005, 0.0), side=(-0.075, 0.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_predicted_maximum_of_a_free_swing_is_that_of_the_pendulum(case: str) -> None:
    predicted = next_peak(CASES[case], is_driven=False)

    angle_rad, in_s = largest(CASES[case].mean)
    assert predicted.angle_rad == pytest.approx(angle_rad, rel=0.01)
    if case != "circular":  # every moment is a maximum
        assert predicted.in_s == pytest.approx(in_s, abs=0.015 * SWING_S)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_predicted_maximum_holds_for_any_swing_with_a_lean(seed: int) -> None:
    rng = np.random.default_rng(seed)
    swing = SwingPhase(np.array([*rng.normal(0, 0.06, 4), *rng.normal(0, 0.01, 2), 0, 0]), np.zeros((8, 8)), RATE_1_S)

    angle_rad, _ = largest(swing.mean)

    assert next_peak(swing, is_driven=False).angle_rad == pytest.approx(angle_rad, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("pivot", [(0.03, 0.0), (-0.02, 0.03)])
def test_predicted_maximum_holds_while_the_pivot_keeps_its_acceleration(pivot: tuple[float, float]) -> None:
    driven = phase((0.02, -0.03), (0.05, 0.02), pivot=pivot)

    predicted = next_peak(driven, is_driven=True)

    angle_rad, in_s = largest(driven.mean)
    assert predicted.angle_rad == pytest.approx(angle_rad, rel=0.01)
    assert predicted.in_s == pytest.approx(in_s, abs=0.015 * SWING_S)


def test_acceleration_of_the_pivot_does_not_count_when_it_coasts() -> None:
    free = phase((0.02, -0.03), (0.05, 0.02))
    driven = phase((0.02, -0.03), (0.05, 0.02), pivot=(0.03, 0.01))

    assert next_peak(driven, is_driven=False) == next_peak(free, is_driven=False)
    assert next_peak(driven, is_driven=True) != next_peak(free, is_driven=True)


@pytest.mark.slow
@pytest.mark.parametrize("is_driven", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_uncertainty_of_the_maximum_is_the_spread_of_the_maxima(seed: int, is_driven: bool) -> None:
    rng = np.random.default_rng(seed)
    mean = np.array([*rng.normal(0, 0.08, 4), *rng.normal(0, 0.005, 2), *rng.normal(0, 0.02, 2)])
    root = 5e-4 * rng.normal(size=(8, 8))
    swing = SwingPhase(mean, root @ root.T, RATE_1_S)
    draws = mean + rng.normal(size=(2000, 8)) @ root.T

    angles = [next_peak(SwingPhase(each, swing.covariance, RATE_1_S), is_driven=is_driven).angle_rad for each in draws]

    assert next_peak(swing, is_driven=is_driven).u_rad == pytest.approx(np.std(angles), rel=0.1)


def test_load_at_rest_has_no_maximum_above_its_lean() -> None:
    assert next_peak(phase((0.0, 0.0), (0.0, 0.0)), is_driven=False).angle_rad == 0.0
    leaning = next_peak(phase((0.02, 0.0), (0.0, 0.0), side=(-0.02, 0.0)), is_driven=False)
    assert leaning.angle_rad == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_ellipse_of_a_harmonic_motion_is_the_planted_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    major, direction = rng.uniform(0.02, 0.2), rng.uniform(-np.pi / 2, np.pi / 2)
    minor, turning = rng.uniform(0, 0.9) * major, rng.choice([-1, 1])
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.exp(1j * direction)
    place = turn * complex(major * np.cos(angle), turning * minor * np.sin(angle))
    rate = turn * complex(-major * np.sin(angle), turning * minor * np.cos(angle))

    found = ellipse(place, rate)

    assert found[:2] == pytest.approx((major, minor), abs=1e-12)
    assert np.angle(np.exp(2j * (found[2] - direction))) == pytest.approx(0.0, abs=1e-9)


def test_a_gust_may_end_now_as_a_drive_may() -> None:
    """From rest under a force that has just begun: if it goes on, the load swings to twice its lean, and else hardly at all."""
    mean = np.zeros(N_STATES)
    mean[LN_LENGTH], mean[GUST], mean[SIDE_FORCE] = np.log(LENGTH_M), (0.05, 0.0), (0.01, 0.0)
    mean[GRAVITY] = (-0.01, 0.0)  # it hung at the lean of the steady wind
    state = Described(mean, 1e-8 * np.eye(N_STATES), np.ones(N_HYPOTHESES) / N_HYPOTHESES)
    lasting, ended = (swing_phase(state, GRAVITY_M_S2, 0.0, gust_lasts=lasts) for lasts in (True, False))
    assert next_peak(lasting, is_driven=True).angle_rad == pytest.approx(0.01 + 2 * 0.05, rel=0.01)
    assert next_peak(ended, is_driven=False).angle_rad == pytest.approx(0.01, rel=0.01)
