"""Load, rope and pivot as bodies, against closed forms."""

import numpy as np
import pytest

from gateway.twin.model import EffectValues, TwinRig
from tests.blind.engine import simulate
from tests.blind.mechanics import Hook, Mechanics, Start, Structure
from tests.gateway.twin.swings import LENGTH_M, PERIOD_S, RIG, SWING_RATE, G, at_pivot, peaks, predicted

GYRATION_M = 2.5


def period_s(rig: TwinRig, effects: EffectValues, start: list[float], swings: int = 6) -> float:
    time_s = np.arange(0, (swings + 0.5) * 2 * np.pi / SWING_RATE, 0.01)
    when, _ = peaks(time_s, predicted(rig, effects, start, time_s)[:, 0])
    return float(np.diff(when).mean())


def test_period_of_a_load_with_inertia_is_that_of_a_compound_pendulum() -> None:
    found = period_s(at_pivot(), {"load_inertia": {"radius_of_gyration_m": GYRATION_M}}, [1e-3, 0, 0, 0])
    assert found == pytest.approx(2 * np.pi * np.sqrt((LENGTH_M**2 + GYRATION_M**2) / (G * LENGTH_M)), rel=1e-6)


def test_inertia_gives_the_samples_of_a_longer_rope_while_no_length_changes() -> None:
    time_s, start = np.arange(0, 40, 0.1), [0.3, -0.1, 0.05, 0.1, 0.2]
    inertia = predicted(RIG, {"load_inertia": {"radius_of_gyration_m": GYRATION_M}}, start, time_s)
    longer = {"rope_length": {"relative_error": GYRATION_M**2 / LENGTH_M**2}}
    assert inertia == pytest.approx(predicted(RIG, longer, start, time_s), abs=1e-12)


def test_hoisting_separates_inertia_from_a_longer_rope() -> None:
    """Half the length doubles k^2/L and halves e L."""
    time_s, start = np.arange(0, 60, 0.1), [0.1, 0, 0, 0]
    hoist = {"hoisting": {"speed_m_s": -0.3, "start_s": 5.0, "duration_s": 15.0, "rising_share": 0.1}}
    inertia = predicted(at_pivot(), {"load_inertia": {"radius_of_gyration_m": GYRATION_M}} | hoist, start, time_s)
    longer = {"rope_length": {"relative_error": GYRATION_M**2 / LENGTH_M**2}}
    assert np.abs(inertia - predicted(at_pivot(), longer | hoist, start, time_s)).max() > 0.02


@pytest.mark.parametrize("hook", [None, Hook(3.0, 0.15)])
def test_load_with_inertia_agrees_with_rigid_bodies_of_mujoco(hook: Hook | None) -> None:
    """On a hook, a rigid load at the end of its rigging is two point loads, at the hook and at its centre of oscillation."""
    mechanics = Mechanics(LENGTH_M, RIG.position_m, G, gyration_m=GYRATION_M, hook=hook)
    motion = simulate(mechanics, Start((0.1, 0.0), (0.0, 0.05), 0.0), 30.0)
    effects: dict[str, dict[str, float]] = {"load_inertia": {"radius_of_gyration_m": GYRATION_M}}
    start = [0.1, 0, 0, 0.05 * np.cos(0.1), 0]
    if hook is not None:
        effects["double_pendulum"] = {"rigging_length_m": 3.0, "hook_mass_ratio": 0.15}
        start += start[:4]
    found = predicted(RIG, effects, start, motion.time_s[::20])
    assert found == pytest.approx(motion.force_m_s2[::20] / G, abs=5e-5)


@pytest.mark.parametrize(("direction", "soft_m"), [([1e-3, 0, 0, 0], 0.6), ([0, 1e-3, 0, 0], 0.1)])
def test_period_on_a_yielding_pivot_is_that_of_the_rope_and_the_deflection(
    direction: list[float], soft_m: float
) -> None:
    """omega^2 = g/(L + c) in each principal direction; a housing at r reads (L - r)/(L + c) of the angle."""
    effects = {"pivot_compliance": {"compliance_m": (0.6, 0.0, 0.1)}}
    axis, period = int(direction[1] > 0), 2 * np.pi * np.sqrt((LENGTH_M + soft_m) / G)
    time_s = np.arange(0, 6.5 * period, 0.01)
    reading = predicted(RIG, effects, direction, time_s)[:, axis]
    when, height = peaks(time_s, reading)
    assert np.diff(when).mean() == pytest.approx(period, rel=1e-6)
    assert height.max() == pytest.approx(1e-3 * (LENGTH_M - RIG.position_m) / (LENGTH_M + soft_m), rel=1e-5)


def test_two_periods_turn_an_ellipse_into_a_line_and_back_the_other_way_round() -> None:
    """After a quarter of the beat between the two periods the load goes along a line, after half of it backwards."""
    soft_m = 0.8
    rates = np.sqrt(G / np.array([LENGTH_M + soft_m, LENGTH_M]))
    half_beat_s = np.pi / (rates[1] - rates[0])
    time_s = np.array([3.5, half_beat_s / 2, half_beat_s])[:, None] + np.arange(-3.5, 3.5, 0.01)
    effects = {"pivot_compliance": {"compliance_m": (soft_m, 0.0, 0.0)}}
    reading = predicted(at_pivot(), effects, [1e-3, 0, 0, 1e-3 * rates[1]], time_s.ravel())[:, :2].reshape(3, -1, 2)
    x, y = reading[..., 0], reading[..., 1]
    turning = np.mean(x[:, :-1] * np.diff(y) - y[:, :-1] * np.diff(x), axis=1)
    assert turning[0] > 0
    assert turning[1] == pytest.approx(0, abs=0.02 * turning[0])
    assert turning[2] == pytest.approx(-turning[0], rel=0.02)


def test_energy_stays_on_a_yielding_pivot() -> None:
    """The load turns round at the same height after a hundred swings in the plane of the soft direction."""
    effects = {"pivot_compliance": {"compliance_m": (0.6, 0.0, 0.1)}}
    time_s = np.arange(0, 100 * PERIOD_S, 0.02)
    _, height = peaks(time_s, predicted(at_pivot(), effects, [0.1, 0, 0, 0], time_s)[:, 0])
    assert height[-1] == pytest.approx(height[0], rel=1e-5)


def test_stiff_limit_of_a_structure_with_a_mode_of_its_own_is_the_compliance() -> None:
    """MuJoCo: a mass on springs that carries the pivot, its mode far above the swing."""
    structure = Structure(frequency_hz=8.0, damping_ratio=0.05, deflection_m=(0.3, 0.05), azimuth_rad=0.0)
    mechanics = Mechanics(LENGTH_M, RIG.position_m, G, structure=structure)
    motion = simulate(mechanics, Start((0.02, 0.01), (0.0, 0.01), 0.0), 30.0)
    effects = {"pivot_compliance": {"compliance_m": (0.3, 0.0, 0.05)}}
    found = predicted(RIG, effects, [0.02, 0.01, 0, 0.01, 0], motion.time_s[::20])
    rigid = predicted(RIG, {}, [0.02, 0.01, 0, 0.01, 0], motion.time_s[::20])
    settled = slice(100, None)  # the structure's own mode has died away
    readings = motion.force_m_s2[::20] / G
    error_g, effect_g = (np.abs(readings - each)[settled].max() for each in (found, rigid))
    assert error_g < 0.02 * effect_g
