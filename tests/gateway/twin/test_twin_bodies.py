"""Load, rope and pivot as bodies, against closed forms."""

import numpy as np
import pytest

from gateway.twin.model import EffectValues, TwinRig
from tests.blind.engine import simulate
from tests.blind.mechanics import Hook, Mechanics, Start
from tests.gateway.twin.swings import LENGTH_M, RIG, SWING_RATE, G, at_pivot, peaks, predicted

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
