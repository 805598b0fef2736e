"""Forecasts of a plan against fits: recordings are simulated, and the wrong effect is fitted to them."""

import numpy as np
import pytest

from gateway.twin.experiment_design.experiment import FREE_SWING, Run
from gateway.twin.experiment_design.plan import Pair, forecast, plan
from gateway.twin.experiment_design.signatures import initial_state_of, parse_hypotheses
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING
from tests.gateway.twin.swings import Array

pytestmark = pytest.mark.slow

RATE_HZ = 10.0
RIG = TwinRig(length_m=12.0, position_m=5.0, sample_rate_hz=RATE_HZ)
WIND = {"steady_wind": {"accel_m_s2": (0.2, 0.0)}}


def recorded(run: Run, truth: EffectValues, seed: int = 3) -> tuple[Array, Array]:
    """Return times and noisy readings of one recording with the true effect, a little off the planned initial state."""
    time_s = np.arange(round(run.duration_s * RATE_HZ)) / RATE_HZ
    acting = {**truth, **run.inputs(RIG)}
    simulator = Simulator(RIG, sorted(acting))
    values = simulator.values(initial_state_of(run, RIG, simulator.structure), acting)
    values[0] += 0.01
    random = np.random.default_rng(seed)
    return time_s, simulator.predict(values, time_s) + RIG.noise_g * random.standard_normal((len(time_s), 3))


def chi2_fitted(run: Run, name: str, time_s: Array, force_g: Array) -> tuple[float, int]:
    """Return chi-square after a Gauss-Newton fit of initial state, the operator's input and one effect."""
    inputs = run.inputs(RIG)
    simulator = Simulator(RIG, sorted({*inputs, name}))
    values = simulator.values(initial_state_of(run, RIG, simulator.structure), inputs)
    free = np.array([i != HEADING for i in range(len(values))])
    for _ in range(12):
        found = simulator.linearise(values, time_s)
        residual = ((force_g - found.force_g) / RIG.noise_g).ravel()
        columns = (found.jacobian / np.array(RIG.noise_g)[:, None]).reshape(residual.size, -1)[:, free]
        values[free] += np.linalg.lstsq(columns, residual, rcond=1e-10)[0]
    return float(np.sum(((force_g - simulator.predict(values, time_s)) / RIG.noise_g) ** 2)), residual.size


@pytest.fixture(scope="module")
def proposed() -> tuple[Run, Pair]:
    found = plan(RIG, [parse_hypotheses("steady_wind,axis_offset[x+y]")]).groups[0]
    assert found.is_distinguishable
    assert found.experiment is not None
    (run,) = found.experiment.runs
    return run, found.pairs[0]


def test_wrong_effect_explains_a_free_swing_almost_completely(proposed: tuple[Run, Pair]) -> None:
    time_s, force_g = recorded(FREE_SWING.runs[0], WIND)
    chi2, count = chi2_fitted(FREE_SWING.runs[0], "axis_offset", time_s, force_g)
    assert chi2 / count < 1.5


def test_wrong_effect_does_not_explain_the_planned_experiment(proposed: tuple[Run, Pair]) -> None:
    run, pair = proposed
    time_s, force_g = recorded(run, WIND)
    wrong, count = chi2_fitted(run, "axis_offset", time_s, force_g)
    right, _ = chi2_fitted(run, "steady_wind", time_s, force_g)
    assert right / count == pytest.approx(1.0, abs=0.1)
    assert wrong / count > 100
    assert pair.after is not None
    assert np.sqrt(wrong - right) > pair.after.sigma


def test_forecast_separation_equals_that_of_a_fit() -> None:
    (pair,) = forecast(RIG, {}, FREE_SWING, parse_hypotheses("coulomb_friction,viscous_damping"))
    run = FREE_SWING.runs[0]
    time_s, force_g = recorded(run, {"coulomb_friction": {"decel_m_s2": 4e-3}})
    wrong, _ = chi2_fitted(run, "viscous_damping", time_s, force_g)
    right, _ = chi2_fitted(run, "coulomb_friction", time_s, force_g)
    assert np.sqrt(wrong - right) == pytest.approx(pair.sigma, rel=0.15)
