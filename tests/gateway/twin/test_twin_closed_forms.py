"""The twin against closed forms."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from devices.pendulum.double_pendulum import modes
from gateway.twin.effects import Values
from gateway.twin.model import EffectValues, TwinRig
from tests.gateway.twin.swings import (
    LENGTH_M,
    PERIOD_S,
    RIG,
    SWING_RATE,
    Array,
    G,
    at_pivot,
    peaks,
    predicted,
    rope_angle,
)


@pytest.mark.parametrize("amplitude_deg", [1.0, 10.0, 30.0])
def test_period_grows_with_amplitude(amplitude_deg: float) -> None:
    amplitude = np.radians(amplitude_deg)
    time_s = np.arange(0, 8 * PERIOD_S, 0.01)
    force = predicted(at_pivot(), {}, [amplitude, 0, 0, 0], time_s)
    when, _ = peaks(time_s, np.arctan2(force[:, 0], force[:, 2]))
    measured = np.diff(when).mean()
    series = PERIOD_S * (1 + amplitude**2 / 16 + 11 * amplitude**4 / 3072)
    assert measured == pytest.approx(series, rel=2 * 173 / 737280 * amplitude**6 + 2e-6)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.85, 1.0])
def test_extremes_of_a_planar_swing_follow_the_closed_form(rho: float) -> None:
    """Transverse (1 - rho) sin, axial from cos to 1 + 2 rho (1 - cos)."""
    phi = np.radians(11.0)
    force = predicted(TwinRig(LENGTH_M, rho * LENGTH_M), {}, [phi, 0, 0, 0], np.arange(0, PERIOD_S, 0.002))
    assert np.hypot(force[:, 0], force[:, 1]).max() == pytest.approx((1 - rho) * np.sin(phi), abs=1e-6)
    assert force[:, 2].min() == pytest.approx(np.cos(phi), abs=1e-6)
    assert force[:, 2].max() == pytest.approx(1 + 2 * rho * (1 - np.cos(phi)), abs=1e-6)


def envelope(effects: EffectValues, amplitude: float, swings: int) -> tuple[Array, Array]:
    time_s = np.arange(0, swings * PERIOD_S, 0.02)
    force = predicted(at_pivot(), effects, [amplitude, 0, 0, 0], time_s)
    when, height = peaks(time_s, np.arctan2(force[:, 0], force[:, 2]))
    return np.concatenate([[0.0], when]), np.concatenate([[amplitude], height])


def test_viscous_damping_decays_as_an_exponential() -> None:
    when, height = envelope({"viscous_damping": {"damping_ratio": 0.01}}, 0.05, 20)
    assert height == pytest.approx(0.05 * np.exp(-0.01 * SWING_RATE * when), rel=1e-3)


def test_damping_ratio_refers_to_the_length_that_is_true() -> None:
    """Seen from the pivot, a stated length that is 44 % too short is the longer rope, its loss included."""
    damping: EffectValues = {"viscous_damping": {"damping_ratio": 0.01}}
    stated: EffectValues = {**damping, "rope_length": {"relative_error": 0.44}}
    time_s = np.arange(0, 5 * PERIOD_S, 0.05)
    longer, corrected = (
        predicted(at_pivot(length_m), effects, [0.3, 0, 0, 0.1], time_s)
        for length_m, effects in ((1.44 * LENGTH_M, damping), (LENGTH_M, stated))
    )
    assert corrected == pytest.approx(longer, abs=1e-8)


def test_quadratic_drag_decays_as_a_hyperbola() -> None:
    """A' = -(4/3 pi) k L w A^2."""
    drag_per_m = 0.02
    when, height = envelope({"quadratic_drag": {"drag_per_m": drag_per_m}}, 0.08, 20)
    rate = 4 / (3 * np.pi) * drag_per_m * LENGTH_M * SWING_RATE
    assert height == pytest.approx(0.08 / (1 + 0.08 * rate * when), rel=3e-3)


def test_coulomb_friction_decays_linearly() -> None:
    """A' = -2 mu/(pi w L) of an angle."""
    decel_m_s2 = 0.01
    when, height = envelope({"coulomb_friction": {"decel_m_s2": decel_m_s2}}, 0.08, 12)
    slope = 2 * decel_m_s2 / (np.pi * SWING_RATE * LENGTH_M)
    assert height == pytest.approx(0.08 - slope * when, abs=2e-4)


@pytest.mark.parametrize("amplitude_deg", [20.0, 60.0])
@pytest.mark.parametrize("decel_m_s2", [0.005, 0.05])
def test_coulomb_friction_takes_its_work_from_each_half_swing_of_any_size(
    amplitude_deg: float, decel_m_s2: float
) -> None:
    """G (cos B - cos A) = mu (A + B) between two turning points A and B."""
    when, height = envelope({"coulomb_friction": {"decel_m_s2": decel_m_s2}}, np.radians(amplitude_deg), 12)
    expected = [np.radians(amplitude_deg)]
    for _ in range(2 * len(when) - 2):
        last = expected[-1]
        work = partial(lambda angle, a: G * (np.cos(angle) - np.cos(a)) - decel_m_s2 * (a + angle), a=last)
        expected.append(brentq(work, 0.0, last))
    assert height == pytest.approx(expected[::2], rel=0, abs=2e-3 * (expected[0] - expected[-1]) + 2e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude_deg", "within_rad"), [(80.0, 3e-5), (120.0, 2e-3)])
def test_large_swing_is_right_after_many_periods(amplitude_deg: float, within_rad: float) -> None:
    """Also where the rope would have to push: a rigid link."""
    amplitude, time_s = np.radians(amplitude_deg), np.arange(0, 36 * PERIOD_S, 0.05)
    exact = solve_ivp(
        lambda _, y: (y[1], -(SWING_RATE**2) * np.sin(y[0])),
        (0.0, time_s[-1]),
        [amplitude, 0.0],
        method="DOP853",
        t_eval=time_s,
        rtol=1e-12,
        atol=1e-12,
    )
    aside = np.sin(amplitude) * np.sqrt(0.5)
    force = predicted(at_pivot(), {}, [np.arctan2(aside, np.cos(amplitude)), np.arcsin(aside), 0, 0], time_s)
    assert rope_angle(force) == pytest.approx(np.abs(exact.y[0]), abs=within_rad)


def test_lean_under_steady_wind_is_force_over_weight() -> None:
    lean = np.arctan(0.4 / G)
    force = predicted(RIG, {"steady_wind": {"accel_m_s2": (0.4, 0.0)}}, [lean, 0, 0, 0], np.arange(0, 30, 0.1))
    assert force == pytest.approx(np.tile([np.sin(lean), 0.0, np.cos(lean)], (300, 1)), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("which", [0, 1])
def test_double_pendulum_swings_in_its_modes(which: int) -> None:
    rigging_m, ratio = 3.0, 0.2
    mode = modes(LENGTH_M - rigging_m, rigging_m, ratio, G)[which]
    tilt = 1e-4
    time_s = np.arange(0, 6 * PERIOD_S, 0.005)
    start = [tilt, 0, 0, 0, 0, mode.rigging_tilt * tilt, 0, 0, 0]
    effects = {"double_pendulum": {"rigging_length_m": rigging_m, "hook_mass_ratio": ratio}}
    force = predicted(at_pivot(), effects, start, time_s)
    assert np.arctan2(force[:, 0], force[:, 2]) == pytest.approx(tilt * np.cos(mode.rate * time_s), abs=2e-3 * tilt)


def test_elastic_rope_oscillates_at_its_frequency_with_its_damping() -> None:
    effects = {"rope_stretch": {"frequency_hz": 2.0, "damping_ratio": 0.01}}
    time_s = np.arange(0, 10, 0.005)
    force = predicted(RIG, effects, [0, 0, 0, 0, 0, 0.004, 0.0], time_s)
    omega = 2 * np.pi * 2.0
    damped = omega * np.sqrt(1 - 0.01**2)
    decay = np.exp(-0.01 * omega * time_s)
    place = 0.004 * decay * (np.cos(damped * time_s) + 0.01 * omega / damped * np.sin(damped * time_s))
    speed = -0.004 * omega**2 / damped * decay * np.sin(damped * time_s)
    acceleration = -(omega**2) * place - 2 * 0.01 * omega * speed
    assert force[:, 2] == pytest.approx(1 - acceleration / G, abs=3e-5)


def test_rope_angle_of_a_conical_pendulum_is_constant() -> None:
    phi = np.radians(6.0)
    rate = np.sqrt(G / (LENGTH_M * np.cos(phi)))
    force = predicted(at_pivot(), {}, [phi, 0, 0, rate * np.sin(phi)], np.arange(0, 120, 0.05))
    assert rope_angle(force) == pytest.approx(phi, abs=1e-6)


def test_lever_arm_adds_the_tangential_and_the_centripetal_acceleration() -> None:
    """At release the sensor d beside the rope reads -d/L sin phi more along z, at the bottom -2 d/L (1 - cos phi) along x."""
    phi, arm_m = 0.3, 0.04
    time_s = np.arange(0, PERIOD_S, 0.002)
    beside = predicted(RIG, {"lever_arm": {"offset_m": (arm_m, 0.0)}}, [phi, 0, 0, 0], time_s)
    added = beside - predicted(RIG, {}, [phi, 0, 0, 0], time_s)

    assert added[0] == pytest.approx([0.0, 0.0, -arm_m / LENGTH_M * np.sin(phi)], abs=1e-9)
    assert added[:, 0].min() == pytest.approx(-2 * arm_m / LENGTH_M * (1 - np.cos(phi)), abs=1e-9)
    assert added[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_lever_arm_of_a_turning_housing_reads_the_centripetal_acceleration() -> None:
    effects: EffectValues = {"lever_arm": {"offset_m": (0.03, -0.02)}, "housing_spin": {"rate_deg_s": 20.0}}
    force = predicted(RIG, effects, np.zeros(5), np.arange(0, 5, 0.1))
    towards_rope_g = -(np.radians(20.0) ** 2) / G * np.array([0.03, -0.02])

    assert force == pytest.approx(np.tile([*towards_rope_g, 1.0], (50, 1)), abs=1e-12)


def test_housing_on_a_soft_clamp_leans_towards_the_force_across_the_rope() -> None:
    """A clamp that yields by C per g turns the direction of the reading by C f_x of f_x, and leaves its magnitude."""
    time_s, start = np.arange(0, PERIOD_S, 0.05), [0.2, 0, 0, 0]
    rigid = predicted(RIG, {}, start, time_s)
    soft = predicted(RIG, {"housing_rocking": {"deg_per_g": (5.0, -3.0)}}, start, time_s)
    direction, turned = (np.arctan2(force[:, 0], force[:, 2]) for force in (rigid, soft))

    assert direction - turned == pytest.approx(np.radians(5.0) * rigid[:, 0], abs=1e-12)
    assert np.linalg.norm(soft, axis=1) == pytest.approx(np.linalg.norm(rigid, axis=1), abs=1e-12)
    across = predicted(RIG, {"housing_rocking": {"deg_per_g": (5.0, -3.0)}}, [0, 0.2, 0, 0], time_s)
    assert np.abs(across[:, 1]).max() > np.abs(rigid[:, 0]).max()


def test_torsion_turns_the_readings_as_a_damped_oscillator() -> None:
    """Angle and rate at the start are those that are given; each period lasts 1/(f sqrt(1 - z^2)) and takes exp(-2 pi z ...)."""
    frequency_hz, damping_ratio = 0.1, 0.05
    values: Values = {"frequency_hz": frequency_hz, "damping_ratio": damping_ratio, "start_deg": (10.0, 3.0)}
    damped = np.sqrt(1 - damping_ratio**2)
    period_s = 1 / (frequency_hz * damped)
    time_s = np.sort(np.concatenate([np.arange(0, 30, 0.01), period_s * np.array([1.0, 2.0])]))
    plain, twisted = (
        predicted(RIG, effects, [0.1, 0, 0, 0.05], time_s) for effects in ({}, {"housing_torsion": values})
    )
    turned = -np.angle((twisted[:, 0] + 1j * twisted[:, 1]) / (plain[:, 0] + 1j * plain[:, 1]))
    decay = np.exp(-2 * np.pi * damping_ratio / damped)

    assert np.degrees(turned[0]) == pytest.approx(10.0, abs=1e-9)
    assert np.degrees(turned[np.searchsorted(time_s, period_s * np.array([1.0, 2.0]))]) == pytest.approx(
        10.0 * decay ** np.array([1, 2]), abs=1e-6
    )
    rate_deg_s = 2 * np.pi * frequency_hz * (damped * 3.0 - damping_ratio * 10.0)
    assert np.degrees(turned[1] - turned[0]) / 0.01 == pytest.approx(rate_deg_s, abs=0.03)
    assert twisted[:, 2] == pytest.approx(plain[:, 2], abs=1e-12)
