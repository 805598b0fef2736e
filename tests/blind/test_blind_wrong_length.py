"""Large swings by MuJoCo on a rope that is not as long as the rig states: the length and the loss are both found."""

from dataclasses import dataclass

import numpy as np
import pytest

from devices.pendulum.small_swing import small_swing_period_s
from gateway.twin.model import Model, TwinRig
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations, make_observations, split_recordings
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import Budget, make_context
from gateway.twin.reconcile.search.steps import fit_baseline
from gateway.twin.reconcile.search.validation import Validator
from tests.blind.rigid_pendulum import GRAVITY_M_S2, RigidPendulum, simulate

pytestmark = pytest.mark.slow

NOISE_G = 1e-3
PERIODS, SAMPLES_PER_PERIOD = 14, 30


@dataclass(frozen=True)
class Case:
    """A pendulum, its release, and by how much the true length exceeds the stated one."""

    body: RigidPendulum
    tilt_deg: float
    length_error: float

    @property
    def rig(self) -> TwinRig:
        """The rig as it is stated."""
        return TwinRig(self.body.line_m / (1 + self.length_error), self.body.sensor_m, GRAVITY_M_S2, (NOISE_G,) * 3)

    def observations(self) -> Observations:
        """What the housing reads, with noise."""
        period_s = small_swing_period_s(self.body.line_m, GRAVITY_M_S2)
        motion = simulate(self.body, np.radians(self.tilt_deg), 0.4, 0.1 / period_s, PERIODS * period_s)
        time_s = np.arange(0, motion.time_s[-1], period_s / SAMPLES_PER_PERIOD)
        force_g = np.stack([np.interp(time_s, motion.time_s, axis) for axis in motion.force_g.T], axis=1)
        force_g += NOISE_G * np.random.default_rng(5).normal(size=force_g.shape)
        return make_observations(time_s, force_g, None, np.full(3, NOISE_G))


def reconciled(case: Case) -> Reconciliation:
    log = case.observations()
    return reconcile(Model(case.rig, {}), CheckedRecording(log, None, {}, log.time_s), None)


def baseline(case: Case) -> dict[str, float]:
    """Return the effects of the baseline, each with its first parameter."""
    recordings = split_recordings(case.observations(), None, case.rig.small_swing_period_s)
    context = make_context(Model(case.rig, {}), recordings.log, Budget(), lambda: None)
    table = context.fit(CandidateTable(recordings.log), {})
    _, context = fit_baseline(table, context, {}, Validator(case.rig, {}, recordings.selection))
    return {name: float(np.asarray(next(iter(each.values())))) for name, each in context.baseline_effects.items()}


DAMPED = RigidPendulum(line_m=2.0, sensor_m=1.0, damping_ratio=0.004)


@pytest.mark.parametrize(
    ("case", "loss", "size"),
    [
        (Case(RigidPendulum(line_m=0.5, sensor_m=0.15, drag=0.02), 60.0, 0.25), "quadratic_drag", 0.04),
        (
            Case(RigidPendulum(line_m=3.0, sensor_m=1.5, friction=0.003), 75.0, -0.25),
            "coulomb_friction",
            0.003 * GRAVITY_M_S2,
        ),
        (Case(RigidPendulum(line_m=20.0, sensor_m=16.0, damping_ratio=0.004), 40.0, 0.2), "viscous_damping", 0.004),
    ],
)
def test_a_wrong_length_and_the_loss_of_a_large_swing_are_named_with_their_values(
    case: Case, loss: str, size: float
) -> None:
    result = reconciled(case)
    named = {effect.name: next(iter(effect.parameters.values())) for effect in result.effects}
    assert (result.verdict, set(named)) == ("named", {"rope_length", loss})
    for name, true in (("rope_length", case.length_error), (loss, size)):
        low, high = named[name].ci95
        assert float(np.asarray(low)) <= true <= float(np.asarray(high)), (name, named[name])


def test_a_clock_says_the_same_of_a_housing_at_the_pivot() -> None:
    result = reconciled(Case(RigidPendulum(line_m=2.0, sensor_m=0.0, drag=0.02), 55.0, 0.2))
    assert result.verdict == "one_of"
    assert set(result.candidates) == {"clock_drift", "rope_length"}
    assert [effect.name for effect in result.effects] == ["quadratic_drag"]


def test_the_search_starts_from_the_length_that_the_period_tells() -> None:
    assert baseline(Case(DAMPED, 60.0, 0.2)) == {"rope_length": pytest.approx(0.2, abs=0.05)}


@pytest.mark.parametrize("tilt_deg", [60.0, 15.0])
def test_a_length_that_the_period_does_not_contradict_is_left_to_the_search(tilt_deg: float) -> None:
    assert baseline(Case(DAMPED, tilt_deg, 0.0 if tilt_deg > 30 else 0.2)) == {}
