"""Load, rope and pivot as bodies, against closed forms."""

import numpy as np
import pytest

from devices.pendulum.equations import acceleration_on_yielding_pivot
from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, TwinRig
from tests.blind.engine import simulate
from tests.blind.mechanics import Hook, Mechanics, Start, Structure
from tests.gateway.twin.swings import LENGTH_M, RIG, SWING_RATE, G, at_pivot, peaks, predicted

GYRATION_M = 2.5


def period_s(rig: TwinRig, effects: EffectValues, start: list[float], swings: int = 6) -> float:
    time_s = np.arange(0, (swings + 0.5) * 2 * np.pi / SWING_RATE, 0.01)
    when, _ = peaks(time_s, predicted(rig, effects, start, time_s)[:, 0])
    return float(np.diff(when).mean())


def test_period_of_a_load_with_inertia_is_that_of_a_compound_pendulum() -> None:
    found = period_s(at_pivot(), {"load_inertia": {"radius_of_gyration_m": GYRATION_M}}, [1e-3, 0, 0, 0])
    assert found == pytest.approx(2 * np.pi * np.sqrt((LENGTH_M**2 + GYRATION_M**2) / (G * LENGTH_M)), rel=1e-6)


def test_hoisting_separates_inertia_from_a_longer_rope() -> None:
    """Half the length doubles k^2/L and halves e L."""
    time_s, start = np.arange(0, 60, 0.1), [0.1, 0, 0, 0]
    hoist = {"hoisting": {"speed_m_s": -0.3, "start_s": 5.0, "duration_s": 15.0, "rising_share": 0.1}}
    inertia = predicted(at_pivot(), {"load_inertia": {"radius_of_gyration_m": GYRATION_M}} | hoist, start, time_s)
    longer = {"rope_length": {"relative_error": GYRATION_M**2 / LENGTH_M**2}}
    assert np.abs(inertia - predicted(at_pivot(), longer | hoist, start, time_s)).max() > 0.02


@pytest.mark.slow
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
    effects = {"pivot_compliance": {"compliance_m": (0.6, 0.1)}}
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
    effects = {"pivot_compliance": {"compliance_m": (soft_m, 0.0)}}
    reading = predicted(at_pivot(), effects, [1e-3, 0, 0, 1e-3 * rates[1]], time_s.ravel())[:, :2].reshape(3, -1, 2)
    x, y = reading[..., 0], reading[..., 1]
    turning = np.mean(x[:, :-1] * np.diff(y) - y[:, :-1] * np.diff(x), axis=1)
    assert turning[0] > 0
    assert turning[1] == pytest.approx(0, abs=0.02 * turning[0])
    assert turning[2] == pytest.approx(-turning[0], rel=0.02)


def test_no_power_is_lost_on_a_yielding_pivot() -> None:
    """E = n' (B^2 + k^2) n'/2 + g n C n/2 + g L n_z has no derivative, at any state and compliance."""
    random = np.random.default_rng(3)
    for _ in range(20):
        n = random.normal(size=3)
        n /= np.linalg.norm(n)
        rate = np.cross(n, random.normal(size=3))
        xx, xy, yy = random.uniform(-0.1, 0.5, 3)
        compliance = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, 0.0]])
        body = LENGTH_M, 0.0, GYRATION_M**2
        state = (n[0], n[1], n[2]), (rate[0], rate[1], rate[2])
        acceleration = acceleration_on_yielding_pivot(*state, (0.0, 0.0, -G), *body, (xx, xy, yy), G)
        inertia = np.linalg.matrix_power(LENGTH_M * np.eye(3) + compliance, 2) + GYRATION_M**2 * np.eye(3)
        power = rate @ inertia @ acceleration + G * rate @ compliance @ n + G * LENGTH_M * rate[2]
        assert power == pytest.approx(0, abs=1e-10)
        assert n @ np.array(acceleration) == pytest.approx(-rate @ rate, abs=1e-10)


@pytest.mark.slow
def test_stiff_limit_of_a_structure_with_a_mode_of_its_own_is_the_compliance() -> None:
    """MuJoCo: a mass on springs that carries the pivot, its mode far above the swing."""
    structure = Structure(frequency_hz=8.0, damping_ratio=0.05, deflection_m=(0.3, 0.05), azimuth_rad=0.0)
    mechanics = Mechanics(LENGTH_M, RIG.position_m, G, structure=structure)
    motion = simulate(mechanics, Start((0.02, 0.01), (0.0, 0.01), 0.0), 30.0)
    effects = {"pivot_compliance": {"compliance_m": (0.3, 0.05)}}
    found = predicted(RIG, effects, [0.02, 0.01, 0, 0.01, 0], motion.time_s[::20])
    rigid = predicted(RIG, {}, [0.02, 0.01, 0, 0.01, 0], motion.time_s[::20])
    settled = slice(100, None)  # the structure's own mode has died away
    readings = motion.force_m_s2[::20] / G
    error_g, effect_g = (np.abs(readings - each)[settled].max() for each in (found, rigid))
    assert error_g < 0.02 * effect_g


def test_equivalent_of_another_rope_length_gives_its_samples() -> None:
    name, error = "load_inertia", 0.03
    time_s, start = np.arange(0, 40, 0.1), [0.3, -0.1, 0.05, 0.1, 0.2]
    same = EFFECTS[name].equivalent_values({"relative_error": error}, LENGTH_M)
    assert same is not None
    assert EFFECTS[name].equivalent_values({"relative_error": -error}, LENGTH_M) is None
    other_length = {"rope_length": {"relative_error": error}}
    assert predicted(RIG, {name: same}, start, time_s) == pytest.approx(
        predicted(RIG, other_length, start, time_s), abs=1e-12
    )
