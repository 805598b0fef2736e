"""Intervals allow for a companion that acts as well and is too small to be named."""

from collections.abc import Callable

import numpy as np
import pytest

from gateway.numerics.stats import NORMAL_975
from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.intervals import intervals, mixture_interval, standard_uncertainties


def ends(
    model: Model, log: Observations, name: str, stated: EffectValues | None = None
) -> tuple[tuple[float, float], float, float]:
    """The interval of the first value of an effect that is fitted alone, that value, and half its interval without companions."""
    setting = FitContext(model.rig, stated or {}, log, lambda: None)
    fit = setting.fit({name: {}})
    simulator = setting.simulator((name,))
    first = next(i for i, spec in enumerate(simulator.parameters) if spec.effect == name)
    companions = EFFECTS.choose(is_scored=True, needs_temperature=False)
    below, above = intervals(setting, fit, {name: simulator.effects(fit.values)[name]}, companions, 1.0)
    value = float(fit.values[first])
    plain = NORMAL_975 * float(standard_uncertainties(fit, log)[first])
    return (value - float(below[first]), value + float(above[first])), value, plain


@pytest.mark.slow
def test_drag_allows_for_a_damping_that_is_too_small_to_be_named(
    model: Model, record: Callable[..., Observations]
) -> None:
    log = record({"quadratic_drag": {"drag_per_m": 0.012}, "viscous_damping": {"damping_ratio": 0.0004}})
    (low, high), value, plain = ends(model, log, "quadratic_drag")

    assert value - plain > 0.012
    assert low < 0.012 < high
    assert high < value + 1.5 * plain  # a loss beside it can only take a part of the drag


@pytest.mark.slow
def test_a_companion_that_the_rig_states_is_none(model: Model, record: Callable[..., Observations]) -> None:
    losses: EffectValues = {"viscous_damping": {"damping_ratio": 0.0004}, "coulomb_friction": {"decel_m_s2": 0.0}}
    log = record({"quadratic_drag": {"drag_per_m": 0.012}, "viscous_damping": {"damping_ratio": 0.0004}})
    (low, high), _, plain = ends(model, log, "quadratic_drag", losses)

    assert low < 0.012 < high
    assert high - low < 2 * 1.5 * plain


@pytest.mark.slow
def test_an_interval_hardly_widens_where_no_companion_shows(model: Model, record: Callable[..., Observations]) -> None:
    (low, high), _, plain = ends(model, record({"rope_length": {"relative_error": 0.02}}), "rope_length")

    assert low < 0.02 < high
    assert high - low < 2 * 1.5 * plain


def test_interval_of_a_mixture() -> None:
    nowhere, far = np.zeros(64), np.full(64, 100.0)

    assert mixture_interval(nowhere, 2.0, 1.0) == pytest.approx((-2 * NORMAL_975, 2 * NORMAL_975), rel=1e-6)
    assert mixture_interval(far, 1.0, 0.0) == pytest.approx((-NORMAL_975, NORMAL_975), rel=1e-6)
    # Half of the probability is at each place: 5 % of either are outside.
    assert mixture_interval(far, 1.0, 1.0) == pytest.approx((-1.644854, 101.644854), rel=1e-5)
