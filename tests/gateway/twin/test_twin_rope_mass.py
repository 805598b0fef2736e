"""A heavy rope with a load, against the Bessel functions of the hanging string, and against a chain of links."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jv, yv

from devices.pendulum.heavy_rope import HeavyRope
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.model import EffectValues, TwinRig
from tests.blind.engine import simulate
from tests.blind.mechanics import Mechanics, Start
from tests.gateway.twin.swings import LENGTH_M, RIG, SWING_RATE, Array, G, at_pivot, peaks, predicted

BOW_OF_SWING = -2 / np.pi**3
"""Bow of a swinging rope over mass ratio, length and angle, by statics."""


def effects(mass_ratio: float, damping_ratio: float = 0.01) -> EffectValues:
    return {"rope_mass": {"relative_density_1_m": mass_ratio / LENGTH_M, "string_damping_ratio": damping_ratio}}


def swing_start(mass_ratio: float, tilt_rad: float) -> list[float]:
    """Released in the shape of the swing."""
    return [tilt_rad, 0, 0, 0, 0, BOW_OF_SWING * mass_ratio * LENGTH_M * tilt_rad, 0, 0, 0]


def hanging_string(mass_ratio: float) -> list[float]:
    """Rates of the first two modes over √(g/L).

    y = A J₀(z) + B Y₀(z), z = 2 ω √(s/g), with s = L/μ + L − x: y = 0 at the pivot, and A J₂ + B Y₂ = 0 at the load.
    """

    def fault(rate: Array | float) -> Array | float:
        load, pivot = 2 * rate * np.sqrt(1 / mass_ratio), 2 * rate * np.sqrt(1 / mass_ratio + 1)
        found: Array | float = jv(2, load) * yv(0, pivot) - yv(2, load) * jv(0, pivot)
        return found

    tried = np.linspace(0.3, 6 / np.sqrt(mass_ratio), 5000)
    values = fault(tried)
    brackets = np.flatnonzero(np.diff(np.sign(values)))[:2]
    return [float(brentq(fault, tried[i], tried[i + 1])) for i in brackets]


def reading_of_string(mass_ratio: float, share: float) -> float:
    """Transverse reading in g over the load's angle at a share of the length: y' − ω² y, over y at the load."""
    rate = hanging_string(mass_ratio)[0]
    load = 2 * rate * np.sqrt(1 / mass_ratio)

    def mode(order: int, s: float) -> float:
        z = 2 * rate * np.sqrt(s)
        return float(jv(order, z) * yv(2, load) - yv(order, z) * jv(2, load))

    s = 1 / mass_ratio + 1 - share
    found = (mode(1, s) * rate / np.sqrt(s) - rate**2 * mode(0, s)) / mode(0, 1 / mass_ratio)
    return float(found)


@pytest.mark.slow
@pytest.mark.parametrize(("mass_ratio", "rel"), [(0.02, 1e-6), (0.1, 1e-5), (0.3, 1e-4)])
def test_heavy_rope_swings_with_the_slow_mode_of_a_hanging_string(mass_ratio: float, rel: float) -> None:
    time_s = np.arange(0, 60, 0.01)
    when, _ = peaks(
        time_s, predicted(at_pivot(), effects(mass_ratio, 0.3), swing_start(mass_ratio, 1e-4), time_s)[:, 0]
    )
    rate = 2 * np.pi / np.diff(when)[2:].mean()
    assert rate == pytest.approx(hanging_string(mass_ratio)[0] * SWING_RATE, rel=rel)


@pytest.mark.parametrize(("mass_ratio", "rel"), [(0.02, 1e-4), (0.1, 6e-4), (0.3, 4e-3)])
def test_heavy_rope_rings_with_the_second_mode_of_a_hanging_string(mass_ratio: float, rel: float) -> None:
    expected = hanging_string(mass_ratio)[1] * SWING_RATE
    assert HeavyRope(LENGTH_M, 0.0, mass_ratio, 0.0, G).string_rate == pytest.approx(expected, rel=rel)
    time_s = np.arange(0, 30 / expected, 0.002)
    reading = predicted(RIG, effects(mass_ratio, 1e-3), [0, 0, 0, 0, 0, 1e-3, 0, 0, 0], time_s)[:, 0]
    when, _ = peaks(time_s, reading)
    assert 2 * np.pi / np.diff(when).mean() == pytest.approx(expected, rel=5 * rel)


@pytest.mark.slow
@pytest.mark.parametrize("position_m", [0.1, 2.0, 5.0, 9.0])
def test_readings_along_a_heavy_rope_follow_its_shape(position_m: float) -> None:
    mass_ratio, tilt_rad = 0.1, 1e-3
    rig = TwinRig(length_m=LENGTH_M, position_m=position_m)
    time_s = np.arange(0, 40, 0.02)
    reading = predicted(rig, effects(mass_ratio, 0.3), swing_start(mass_ratio, tilt_rad), time_s)[:, 0]
    _, height = peaks(time_s, reading)
    expected = reading_of_string(mass_ratio, position_m / LENGTH_M) * tilt_rad
    assert height[1:].mean() == pytest.approx(expected, rel=3e-3)
    straight = tilt_rad * (1 - position_m / LENGTH_M)
    assert abs(height[1:].mean() - expected) < 0.1 * abs(straight - expected) + 1e-3 * tilt_rad


def test_ringing_of_the_rope_dies_away_at_its_damping_ratio() -> None:
    damping_ratio, time_s = 0.02, np.arange(0, 10, 0.002)
    reading = predicted(RIG, effects(0.1, damping_ratio), [0, 0, 0, 0, 0, 1e-3, 0, 0, 0], time_s)[:, 0]
    when, height = peaks(time_s, reading)
    rate = HeavyRope(LENGTH_M, 0.0, 0.1, 0.0, G).string_rate
    assert -np.polyfit(when, np.log(height), 1)[0] == pytest.approx(damping_ratio * rate, rel=0.02)


def test_blow_on_the_load_rings_the_rope_and_leaves_the_momentum_of_both() -> None:
    """An impulse I on the load changes (1 + mu/3) L n' + (mu/pi) w' by I/m, and the string's own momentum not at all."""
    mass_ratio, jump_m_s = 0.2, 0.05
    rope = HeavyRope(LENGTH_M, 0.0, mass_ratio, 0.0, G)
    nothing, n = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    swing, bow = rope.accelerations(n, nothing, nothing, nothing, nothing, (jump_m_s, 0.0, 0.0))
    assert (1 + mass_ratio / 3) * LENGTH_M * swing[0] + mass_ratio / np.pi * bow[0] == pytest.approx(jump_m_s)
    assert LENGTH_M * swing[0] / np.pi + bow[0] / 2 == pytest.approx(0)


@pytest.mark.slow
@pytest.mark.parametrize(("position_m", "tilt"), [(2.0, (0.15, 0.0)), (9.0, (0.0, -0.1))])
def test_chain_of_links_in_mujoco_reads_what_the_heavy_rope_reads(position_m: float, tilt: tuple[float, float]) -> None:
    """On an elliptical swing, after the chain's higher modes have died away."""
    mass_ratio, rig = 0.1, TwinRig(length_m=LENGTH_M, position_m=position_m)
    mechanics = Mechanics(LENGTH_M, position_m, G, rope_kg=mass_ratio, share=0.0)
    motion = simulate(mechanics, Start(tilt, (0.0, 0.05), 0.4), 45.0)
    time_s, reading = motion.time_s[::10], motion.force_m_s2[::10] / G
    bow = [BOW_OF_SWING * mass_ratio * LENGTH_M * each for each in (*tilt, 0.0, 0.05)]
    start = [*tilt, 0, 0.05 * np.cos(tilt[0]), 0.4]
    settled = slice(800, None)
    found = predicted(rig, effects(mass_ratio, 0.3), [*start, *bow], time_s)
    light = predicted(rig, {}, start, time_s)
    error_g, effect_g = (np.abs(each - reading)[settled].max() for each in (found, light))
    assert error_g < 0.04 * effect_g


def test_equivalent_of_another_rope_length_swings_with_its_period() -> None:
    error, time_s = -0.02, np.arange(0, 60, 0.01)
    same = EFFECTS["rope_mass"].equivalent_values({"relative_error": error}, LENGTH_M)
    assert same is not None
    assert EFFECTS["rope_mass"].equivalent_values({"relative_error": -error}, LENGTH_M) is None
    models: list[EffectValues] = [
        {"rope_mass": {**same, "string_damping_ratio": 0.3}},
        {"rope_length": {"relative_error": error}},
    ]
    heavy, shorter = (
        float(np.diff(peaks(time_s, predicted(at_pivot(), each, [1e-3, 0, 0, 0], time_s)[:, 0])[0])[2:].mean())
        for each in models
    )
    assert heavy == pytest.approx(shorter, rel=4e-4)


@pytest.mark.parametrize(("damping_ratio", "is_found"), [(0.02, True), (1e-3, False)])
def test_mass_of_the_rope_is_guessed_from_ringing_that_dies_away(damping_ratio: float, is_found: bool) -> None:
    mass_ratio, time_s, noise_g = 0.08, np.arange(0, 60, 0.02), np.full(3, 1e-3)
    start = swing_start(mass_ratio, 0.1)
    start[5] += 0.01
    force_g = predicted(RIG, effects(mass_ratio, damping_ratio), start, time_s)
    force_g += noise_g * np.random.default_rng(1).standard_normal(force_g.shape)
    residual_g = force_g - predicted(RIG, {"rope_length": {"relative_error": -mass_ratio / 6}}, start[:5], time_s)
    context = GuessContext(LENGTH_M, G, time_s, force_g, noise_g, residual_g)
    found = [each["relative_density_1_m"] for each in EFFECTS["rope_mass"].initial_guesses(context)]
    assert found == (pytest.approx([mass_ratio / LENGTH_M], rel=0.02) if is_found else [])
