"""A proposal is worth what it promises: recordings are made with and without it, and the wrong name is fitted to both."""

import numpy as np
import pytest

from gateway.twin.experiment_design.candidates import FREE_SWING
from gateway.twin.experiment_design.experiment import Run
from gateway.twin.experiment_design.hypotheses import suspects
from gateway.twin.experiment_design.plan import Pair, forecast, plan
from gateway.twin.experiment_design.signatures import initial_state_of
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING
from tests.gateway.twin.swings import Array
from tests.values import present

pytestmark = pytest.mark.slow

RATE_HZ = 10.0
RIG = TwinRig(length_m=12.0, position_m=5.0, sample_rate_hz=RATE_HZ)
WIND = {"steady_wind": {"accel_m_s2": (0.2, 0.0)}}


def recorded(leg: Run, truth: EffectValues, seed: int = 3) -> tuple[Array, Array]:
    """Times and noisy readings of one recording, a little off the planned start, under the true effect."""
    time_s = np.arange(round(leg.duration_s * RATE_HZ)) / RATE_HZ
    acting = {**truth, **leg.inputs(RIG)}
    simulator = Simulator(RIG, sorted(acting))
    values = simulator.values(initial_state_of(leg, RIG, simulator.structure), acting)
    values[0] += 0.01
    random = np.random.default_rng(seed)
    return time_s, simulator.predict(values, time_s) + RIG.noise_g * random.standard_normal((len(time_s), 3))


def chi2_fitted(leg: Run, name: str, time_s: Array, force_g: Array) -> tuple[float, int]:
    """Sum of squares in sigma after fitting initial motion, the operator's input and one effect, by Gauss and Newton."""
    inputs = leg.inputs(RIG)
    simulator = Simulator(RIG, sorted({*inputs, name}))
    values = simulator.values(initial_state_of(leg, RIG, simulator.structure), inputs)
    free = np.array([i != HEADING for i in range(len(values))])
    for _ in range(12):
        found = simulator.linearise(values, time_s)
        residual = ((force_g - found.force_g) / RIG.noise_g).ravel()
        columns = (found.jacobian / np.array(RIG.noise_g)[:, None]).reshape(residual.size, -1)[:, free]
        values[free] += np.linalg.lstsq(columns, residual, rcond=1e-10)[0]
    return float(np.sum(((force_g - simulator.predict(values, time_s)) / RIG.noise_g) ** 2)), residual.size


@pytest.fixture(scope="module")
def proposed() -> tuple[Run, Pair]:
    found = plan(RIG, [suspects("steady_wind,axis_offset[x+y]")]).groups[0]
    assert found.is_distinguishable
    (leg,) = present(found.manoeuvre).legs
    return leg, found.pairs[0]


def test_in_a_free_swing_the_wrong_name_explains_nearly_all(proposed: tuple[Run, Pair]) -> None:
    time_s, force_g = recorded(FREE_SWING.legs[0], WIND)
    chi2, count = chi2_fitted(FREE_SWING.legs[0], "axis_offset", time_s, force_g)
    assert chi2 / count < 1.5


def test_after_the_proposed_manoeuvre_the_wrong_name_cannot_and_the_right_one_can(proposed: tuple[Run, Pair]) -> None:
    leg, pair = proposed
    time_s, force_g = recorded(leg, WIND)
    wrong, count = chi2_fitted(leg, "axis_offset", time_s, force_g)
    right, _ = chi2_fitted(leg, "steady_wind", time_s, force_g)
    assert right / count == pytest.approx(1.0, abs=0.1)
    assert wrong / count > 100
    assert np.sqrt(wrong - right) > present(pair.after).sigma


def test_the_expected_separation_is_the_one_that_a_fit_finds() -> None:
    (pair,) = forecast(RIG, {}, FREE_SWING, suspects("coulomb_friction,viscous_damping"))
    leg = FREE_SWING.legs[0]
    time_s, force_g = recorded(leg, {"coulomb_friction": {"decel_m_s2": 4e-3}})
    wrong, _ = chi2_fitted(leg, "viscous_damping", time_s, force_g)
    right, _ = chi2_fitted(leg, "coulomb_friction", time_s, force_g)
    assert np.sqrt(wrong - right) == pytest.approx(pair.sigma, rel=0.15)
