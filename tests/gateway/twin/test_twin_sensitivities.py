"""The sensitivities against central differences, for every effect."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from gateway.twin.effects import EFFECTS, Value
from gateway.twin.model import EffectValues
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.swings import RIG, Array

TIME_S = np.arange(0, 30, 0.1)
TEMPERATURE_C = 22 + 15 * (1 - np.exp(-TIME_S / 20))
START = (0.1, -0.04, 0.01, 0.02, 0.3)
MORE = {
    "double_pendulum": (0.12, -0.05, 0.01, 0.03),
    "rope_stretch": (0.004, 0.01),
    "rope_mass": (0.02, -0.01, 0.03, 0.02),
    "pivot_friction": (0.005, -0.003),
}
EVENTS_S = {
    "wind_gust": 12.013,
    "impact": 15.027,
    "trolley_acceleration": 9.031,
    "hoisting": 11.019,
    "load_change": 17.023,
}
NOT_PREDICTED = ("quantization", "sample_hold")
REACHED: EffectValues = {
    "clipping": {"full_scale_g": 1.0},
    "wind_gust": {"rising_share": 0.6},
    "lowpass_lag": {"began_g": (0.01, -0.02, 0.005)},
}


def typical(name: str) -> dict[str, Value]:
    values: dict[str, Value] = {p.name: p.typical for p in EFFECTS[name].parameters}
    values |= REACHED.get(name, {})
    return {**values, "start_s": EVENTS_S[name]} if name in EVENTS_S else values


def case(names: Sequence[str]) -> tuple[Simulator, Array]:
    simulator = Simulator(RIG, names)
    start = [*START, *(each for name in MORE if name in names for each in MORE[name])]
    return simulator, simulator.values(start, {name: typical(name) for name in names})


def disagreements(names: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Yield the error of each sensitivity over its largest value, without samples that a discontinuity passes."""
    simulator, values = case(names)
    jacobian = simulator.linearise(values, TIME_S, TEMPERATURE_C).jacobian
    for i, spec in enumerate(simulator.parameters):
        step = 1e-3 * spec.scale * (np.arange(len(values)) == i)
        above, below = (simulator.predict(values + each, TIME_S, TEMPERATURE_C) for each in (step, -step))
        off = np.abs((above - below) / (2 * step[i]) - jacobian[:, :, i])
        yield spec.label, np.sort(off.max(axis=1))[-3] / np.abs(jacobian[:, :, i]).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in EFFECTS if name not in NOT_PREDICTED])
def test_sensitivities_of_an_effect_equal_difference_quotients(name: str) -> None:
    assert {label: off for label, off in disagreements([name]) if not off < 3e-5} == {}


@pytest.mark.slow
def test_sensitivities_of_all_effects_together_equal_difference_quotients() -> None:
    names = [name for name in EFFECTS if name not in {*NOT_PREDICTED, *MORE, "clipping"}]
    assert {label: off for label, off in disagreements(names) if not off < 2e-4} == {}


@pytest.mark.slow
def test_absent_effects_have_sensitivities() -> None:
    """The score test needs them where nothing acts."""
    names = [name for name, effect in EFFECTS.items() if effect.linear_at_neutral]
    simulator = Simulator(RIG, names)
    values = simulator.values(START, {name: {"start_s": start_s} for name, start_s in EVENTS_S.items()})
    jacobian = simulator.linearise(values, TIME_S, TEMPERATURE_C).jacobian
    when = ("start_s", "duration_s", "coast_s", "rising_share")
    seen = {spec.label for spec, by in zip(simulator.parameters, jacobian.T, strict=True) if np.abs(by).max() > 1e-6}
    assert seen >= {spec.label for spec in simulator.effect_parameters if spec.name not in when}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["impact", "double_pendulum", "rope_stretch", "rope_mass", "clock_drift", "hoisting"])
def test_consecutive_segments_equal_one_trajectory(name: str) -> None:
    simulator, values = case([name])
    firsts, n = [0, 75, 210], simulator.n_initial_states
    whole = simulator.linearise(values, TIME_S)
    starts = np.tile(values[:n], (3, 1))
    for i in (1, 2):
        starts[i] = simulator.linearise_segments(starts, values[n:], TIME_S, firsts).ends[i - 1]
    found = simulator.linearise_segments(starts, values[n:], TIME_S, firsts)
    assert found.force_g == pytest.approx(whole.force_g, abs=2e-6)
    # the chain rule across the segments gives the sensitivities of the one trajectory
    by_start, by_effects = np.eye(n), np.zeros((n, len(values) - n))
    for i, first in enumerate(firsts):
        part = slice(first, (*firsts, len(TIME_S))[i + 1])
        chained = found.force_by_start[part] @ np.hstack([by_start, by_effects])
        chained[..., n:] += found.force_by_effects[part]
        assert chained == pytest.approx(whole.jacobian[part], rel=1e-4, abs=1e-5 * np.abs(whole.jacobian).max())
        by_effects = found.ends_by_start[i] @ by_effects + found.ends_by_effects[i]
        by_start = found.ends_by_start[i] @ by_start
