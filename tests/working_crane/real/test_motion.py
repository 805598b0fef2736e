"""Motions of the simulated cranes, and the reading of the housing, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipk

from tests.blind.mechanics import Array
from tests.working_crane.real.bodies import point
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.engine import simulate
from tests.working_crane.real.housing import housing_motion, untwisted_axes
from tests.working_crane.real.long_hoist import long_hoist
from tests.working_crane.real.moves import Move, Moves
from tests.working_crane.real.one_rope import one_rope
from tests.working_crane.real.rig import G_M_S2, Disturbances, Place, Rig, Rope
from tests.working_crane.real.slewing import BELOW_JIB_M, jib
from tests.working_crane.real.spreader import spreader
from tests.working_crane.real.turbulence import gusty, kaimal

STEP_S = 0.005
LENGTH_M = 12.0


def half_steps(duration_s: float, step_s: float = STEP_S) -> Array:
    return np.arange(2 * round(duration_s / step_s) + 2) * step_s / 2


def stiff(moves: Moves, load_kg: float = 1500.0) -> Rig:
    """A nearly inextensible rope with a point load and no losses."""
    draw = Draw(np.random.default_rng(1), 0, moves.time_s, 10.0)
    parts = one_rope(draw, LENGTH_M, load_kg, 3.0, bounce_hz=25.0, air=False)
    ropes = tuple(replace(rope, damping_n_s_m=0.0) for rope in parts.ropes)
    return Rig(parts.bodies, ropes, parts.place, moves)


def angle_rad(line: Array) -> Array:
    return np.arctan2(line[:, 0], -line[:, 2])


@pytest.mark.slow
def test_wide_free_swing_has_the_period_of_the_elliptic_integral_and_keeps_its_energy() -> None:
    time_s = half_steps(60.0)
    speed = 2 * np.sqrt(G_M_S2 * LENGTH_M) * np.sin(0.15)
    trace = simulate(replace(stiff(Moves(time_s, (), 0.1)), push={"load_x": (speed,)}), STEP_S, round(60 / STEP_S))
    x = angle_rad(trace.sites["load"] - trace.sites["pivot"])
    after = np.flatnonzero(x[:-1] * x[1:] < 0)
    crossings_s = STEP_S * (after - x[after] / (x[after + 1] - x[after]))
    period_s = 2 * (crossings_s[-1] - crossings_s[0]) / (len(crossings_s) - 1)
    assert period_s == pytest.approx(4 * np.sqrt(LENGTH_M / G_M_S2) * ellipk(np.sin(0.15) ** 2), rel=1e-4)
    assert np.abs(x[-2000:]).max() == pytest.approx(0.3, rel=2e-4)


@pytest.mark.slow
def test_transverse_reading_is_the_angular_acceleration_whatever_trolley_and_winch_do() -> None:
    """P f = -d n'' on a straight massless rope."""
    step_s, duration_s = 0.0025, 60.0
    time_s = half_steps(duration_s + 1, step_s)
    draw = Draw(np.random.default_rng(5), 0, time_s, duration_s)
    rig = replace(long_hoist(draw), damping={})
    steps = round(duration_s / step_s)
    trace = simulate(rig, step_s, steps)
    still = np.zeros(steps)
    motion = housing_motion(trace, rig.place, rig.disturbances, still, time_s[::2][:steps])
    n, axes = -motion.up, untwisted_axes(motion.up, still)
    second = (n[2:] - 2 * n[1:-1] + n[:-2]) / step_s**2
    assert rig.place.above_end_m is not None
    expected = -rig.place.above_end_m * np.einsum("nij,ni->nj", axes[1:-1], second)[:, :2] / G_M_S2
    size = np.abs(expected).max()
    assert size > 0.01
    np.testing.assert_allclose(motion.force_g[2:-2, :2], expected[1:-1], atol=1e-4 * size)
    np.testing.assert_allclose(np.einsum("nij,nik->njk", axes, axes), np.tile(np.eye(3), (steps, 1, 1)), atol=1e-12)
    turn = np.sum(np.diff(axes[:, :, 0], axis=0) * (axes[1:, :, 1] + axes[:-1, :, 1]) / 2, axis=1) / step_s
    assert np.abs(turn).max() < 1e-5


@pytest.mark.slow
def test_pivot_moves_and_rope_is_paid_out_as_commanded() -> None:
    time_s = half_steps(30.0)
    moves = Moves(time_s, (Move("x", 2.0, 0.8, 1.5, 4.0), Move("hoist", 3.0, -0.4, 1.0, 5.0, 0.15)), 0.2)
    trace = simulate(stiff(moves), STEP_S, round(30 / STEP_S))
    assert trace.sites["pivot"][-1, 0] == pytest.approx(0.8 * 5.5, rel=1e-4)
    length_m = np.linalg.norm(trace.sites["load"] - trace.sites["pivot"], axis=1)
    assert length_m[-2000:].mean() - length_m[0] == pytest.approx(moves.moves[1].way, rel=2e-3)


@pytest.mark.slow
def test_winch_leaves_the_slings_under_the_hook_as_long_as_they_are() -> None:
    time_s = half_steps(20.0)
    moves = Moves(time_s, (Move("hoist", 1.0, -0.5, 1.0, 8.0), Move("x", 4.0, 0.6, 1.0, 4.0)), 0.2)
    draw = Draw(np.random.default_rng(1), 0, time_s, 20.0)
    parts = one_rope(draw, LENGTH_M, 1500.0, 3.0, bounce_hz=4.0, slings=(2.0, 0.1))
    rig = Rig(parts.bodies, parts.ropes, parts.place, moves, end="hook", damping=parts.damping)
    trace = simulate(rig, STEP_S, round(20 / STEP_S))
    np.testing.assert_allclose(np.linalg.norm(trace.sites["load"] - trace.sites["hook"], axis=1), 2.0, atol=0.01)
    lengths_m = np.linalg.norm(trace.sites["hook"] - trace.sites["pivot"], axis=1)
    assert lengths_m[-500:].mean() == pytest.approx(LENGTH_M - 4.5, abs=0.01)


@pytest.mark.slow
def test_forced_swing_below_resonance_has_the_amplitude_of_the_linear_pendulum() -> None:
    time_s = half_steps(140.0)
    rate, size_m = 2 * np.pi * 0.07, 0.1
    rise = np.clip(time_s / 60.0, 0, 1) ** 3 * (
        10 - 15 * np.clip(time_s / 60.0, 0, 1) + 6 * np.clip(time_s / 60.0, 0, 1) ** 2
    )
    half_s = time_s[1]
    path = np.column_stack([size_m * rise * np.sin(rate * time_s), 0 * time_s, 0 * time_s])
    rig = replace(
        stiff(Moves(time_s, (), 0.1)), pivot_path=np.gradient(np.gradient(path, half_s, axis=0), half_s, axis=0)
    )
    trace = simulate(rig, STEP_S, round(140 / STEP_S))
    angle = angle_rad(trace.sites["load"] - trace.sites["pivot"])[-round(1 / 0.07 / STEP_S) * 4 :]
    phase = rate * STEP_S * np.arange(len(angle))
    amplitude = 2 * abs(np.mean(angle * np.exp(-1j * phase)))
    expected = size_m * rate**2 / G_M_S2 / (1 - rate**2 * LENGTH_M / G_M_S2)
    assert amplitude == pytest.approx(expected, rel=2e-3)


@pytest.mark.slow
def test_load_leans_outward_in_a_steady_slew() -> None:
    time_s = half_steps(75.0)
    radius_m, rate, load_kg = 25.0, 0.12, 2000.0
    moves = Moves(time_s, (Move("slew", 0.0, rate, 25.0, 200.0),), 0.3)
    rope = Rope("rope", ("pivot", "load"), LENGTH_M, 1e8, 1e4, 1)
    bodies = jib(radius_m, 0.0, (1e8, 1e8, 1000.0), "", luffing=False) + point(
        "load", load_kg, radius_m, -BELOW_JIB_M - LENGTH_M
    )
    facts = {"radius_m": radius_m, "height_m": 0.0}
    place = Place("pivot", "load", above_end_m=2.0)
    rig = Rig(bodies, (rope,), place, moves, driven=("slew", "trolley"), mass_damping_1_s=0.0, facts=facts)
    trace = simulate(rig, STEP_S, round(75 / STEP_S))
    line = trace.sites["load"] - trace.sites["pivot"]
    lean = np.arctan2(np.hypot(line[:, 0], line[:, 1]), -line[:, 2])[-round(2 * 7.2 / STEP_S) :].mean()
    expected = 0.0
    for _ in range(50):
        expected = np.arctan(rate**2 * (radius_m + LENGTH_M * np.sin(expected)) / G_M_S2)
    assert lean == pytest.approx(expected, rel=5e-3)


@pytest.mark.slow
def test_housing_on_a_spreader_reads_the_direction_of_its_ropes_at_rest_and_gravity_alone() -> None:
    step_s = 0.0025
    time_s = half_steps(5.0, step_s)
    draw = Draw(np.random.default_rng(3), 1, time_s, 5.0)
    rig = replace(spreader(draw), moves=Moves(time_s, (), 0.2), outside=None)
    trace = simulate(rig, step_s, 400)
    motion = housing_motion(trace, rig.place, Disturbances(), np.zeros(400), time_s[::2][:400])
    np.testing.assert_allclose(motion.force_g[2:-2], np.tile(motion.rest_g, (396, 1)), atol=2e-4)
    assert np.linalg.norm(motion.rest_g) == pytest.approx(1.0)


@pytest.mark.slow
def test_second_difference_of_a_housing_on_the_spreader_is_what_the_engine_s_accelerometer_reads() -> None:
    step_s, duration_s = 0.0025, 25.0
    time_s = half_steps(duration_s, step_s)
    rig = spreader(Draw(np.random.default_rng(4), 1, time_s, duration_s))
    trace = simulate(rig, step_s, round(duration_s / step_s))
    steps = len(trace.touched)
    motion = housing_motion(trace, rig.place, Disturbances(), np.zeros(steps), time_s[::2][:steps])
    assert trace.accelerometer_m_s2 is not None
    assert np.ptp(motion.force_g[2:-2, 0]) > 0.01
    np.testing.assert_allclose(motion.force_g[4:-4], trace.accelerometer_m_s2[4:-4] / G_M_S2, atol=5e-5)


def test_turbulence_has_the_power_of_its_spectrum() -> None:
    time_s = np.arange(0.0, 3000.0, 0.05)
    speed = gusty(np.random.default_rng(2), time_s, 8.0, 1.5, 100.0)
    frequency_hz = np.linspace(1 / 3600, 10.0, 200_000)
    power = np.trapezoid(kaimal(frequency_hz, 8.0, 1.5, 100.0), frequency_hz)
    assert speed.var() == pytest.approx(power, rel=0.1)
    assert power == pytest.approx(1.5**2, rel=0.1)
