"""A step of the search leaves no better set beside it untried."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.observations import make_observations
from gateway.twin.reconcile.search.budget import Budget
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import make_context
from gateway.twin.reconcile.search.persistent import fit_persistent_effects
from gateway.twin.reconcile.search.stepwise_selection import try_swaps
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.reconcile.conftest import RATE_HZ, RIG


@pytest.mark.slow
def test_rivals_of_a_set_are_tried_with_the_effect_that_a_swap_brought_in() -> None:
    """A wide swing at the pivot in coarse noise, as from a video: beside the wrong loss a loose clamp looks like a length."""
    rig = replace(RIG, length_m=0.65, position_m=0.0, noise_g=(0.01,) * 3)
    hidden: EffectValues = {"quadratic_drag": {"drag_per_m": 0.025}, "rope_length": {"relative_error": 0.032}}
    simulator, time_s = Simulator(rig, sorted(hidden)), np.arange(0, 40.0, 1 / 20)
    force_g = simulator.predict(simulator.values([1.1, 0.7, 0.0, 0.0, 0.0], hidden), time_s)
    force_g += 0.007 * np.random.default_rng(5).normal(size=force_g.shape)
    log = make_observations(time_s, force_g, None, np.array(rig.noise_g))
    context = make_context(Model(rig, {}), log, Budget(), lambda: None)
    table = CandidateTable(log)
    for names in ((), ("viscous_damping", "housing_rocking"), ("viscous_damping", "rope_length")):
        table = context.fit(table, {name: {} for name in names})
    table = table.start_round()
    before = table.fits[frozenset({"viscous_damping", "housing_rocking"})]

    table, _ = try_swaps(table, context, before)

    # A clock's rate is that of a length here, and the two are told as a group.
    assert any(table.get({"quadratic_drag", each}) is not None for each in ("rope_length", "clock_drift"))
    assert table.best.names & {"rope_length", "clock_drift"}


@pytest.mark.slow
def test_a_length_that_is_wrong_by_a_fifth_is_fitted_from_that_of_the_period() -> None:
    """From the stated length a swing of 21 degrees loses the phase; a score says nothing of so wrong a length either."""
    hidden: EffectValues = {"viscous_damping": {"damping_ratio": 0.005}, "rope_length": {"relative_error": -0.2}}
    simulator, time_s = Simulator(RIG, sorted(hidden)), np.arange(0, 60.0, 1 / RATE_HZ)
    force_g = simulator.predict(simulator.values([0.33, 0.15, -0.02, 0.05, 0.0], hidden), time_s)
    force_g += RIG.noise_g[0] * np.random.default_rng(0).normal(size=force_g.shape)
    log = make_observations(time_s, force_g, None, np.array(RIG.noise_g))
    context = make_context(Model(RIG, {}), log, Budget(), lambda: None)
    table = fit_persistent_effects(context.fit(CandidateTable(log), {}).start_round(), context)

    assert table.best.names == {"rope_length"}
    assert table.best.values["rope_length"]["relative_error"] == pytest.approx(-0.2, abs=5e-3)
