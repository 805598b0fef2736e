"""Changepoints of transient effects, and persistent effects that are found before an event hides them."""

from collections.abc import Callable

import numpy as np
import pytest

from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import make_candidate
from gateway.twin.reconcile.search.changepoints import (
    exclude_unmodelled_profiles,
    locate_changepoint,
    longest_consistent_prefix,
    scan_for_changepoints,
)

ContextOf = Callable[[EffectValues], FitContext]
HOIST: EffectValues = {"hoisting": {"speed_m_s": -0.15, "start_s": 32.0, "duration_s": 6.0}}
IMPACT: EffectValues = {"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 32.3}}
WIND: EffectValues = {"steady_wind": {"accel_m_s2": (0.15, -0.1)}}


@pytest.fixture
def context_of(rig: TwinRig, record: Callable[..., Observations]) -> ContextOf:
    return lambda effects: FitContext(rig, {}, record(effects), lambda: None)


@pytest.mark.slow
def test_scan_finds_the_window_of_an_impact(context_of: ContextOf) -> None:
    context = context_of({"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 27.3}})
    log, fit = context.log, context.fit({})
    jacobian = context.simulator(()).linearise(fit.values, log.time_s).jacobian / log.noise_g[:, None]
    shortest = scan_for_changepoints(log.time_s, log.residual_sigma(fit.force_g), jacobian[..., :4], log.used)[0]

    assert shortest.from_s == pytest.approx(27.3, abs=1.0)
    assert shortest.to_s == shortest.from_s


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "from_s", "to_s", "length"),
    [
        ({"wind_gust": {"accel_m_s2": (0.2, 0.1), "start_s": 25.0, "duration_s": 6.0}}, 25.0, 31.0, False),
        ({"hoisting": {"speed_m_s": -0.1, "start_s": 25.0, "duration_s": 6.0}}, 25.0, 31.0, True),
        ({"load_change": {"length_change_m": -0.5, "start_s": 28.0}}, 28.0, 28.0, True),
    ],
)
def test_changepoints_enclose_an_event(
    context_of: ContextOf, effects: EffectValues, from_s: float, to_s: float, *, length: bool
) -> None:
    found = locate_changepoint(context_of(effects), {}, length=length)

    assert found is not None
    assert found.from_s == pytest.approx(from_s, abs=1.1)
    assert found.to_s == pytest.approx(to_s, abs=1.1)
    assert found.remaining_chi2 < 1.1 * 3 * 1200


@pytest.mark.slow
def test_no_changepoint_without_an_event_or_where_the_model_is_wrong_from_the_start(context_of: ContextOf) -> None:
    assert locate_changepoint(context_of({}), {}, length=True) is None
    assert locate_changepoint(context_of({"rope_length": {"relative_error": 0.05}}), {}, length=True) is None


@pytest.mark.slow
def test_small_effect_does_not_extend_the_prefix_past_an_event(context_of: ContextOf) -> None:
    context = context_of({"viscous_damping": {"damping_ratio": 0.002}, **IMPACT})
    prefix = longest_consistent_prefix(context, {"viscous_damping": {}})

    assert prefix is not None
    assert context.log.time_s[prefix.end_sample] == pytest.approx(32.3, abs=0.8)


@pytest.mark.slow
def test_suffix_is_found_though_the_wind_seems_to_turn_with_the_housing(context_of: ContextOf) -> None:
    context = context_of({**WIND, **HOIST})
    found = locate_changepoint(context, {"steady_wind": {}}, length=True)

    assert found is not None
    assert (found.from_s, found.to_s) == pytest.approx((32.0, 38.0), abs=0.8)
    assert found.remaining_chi2 < 1.1 * context.log.n_values


@pytest.mark.slow
def test_clock_error_does_not_compensate_for_a_change_of_rope_length(context_of: ContextOf) -> None:
    context = context_of({"clock_drift": {"relative": 0.015}, **HOIST})

    assert locate_changepoint(context, {"clock_drift": {}}, length=False) is None
    assert locate_changepoint(context, {"clock_drift": {}}, length=True) is not None


@pytest.mark.parametrize(
    ("effects", "from_s", "to_s"),
    [
        ({"hoisting": {"start_s": 20.0, "duration_s": 10.0}}, 19.5, 30.5),
        ({"impact": {"start_s": 20.0}}, 19.5, 20.5),
        ({"wind_gust": {"start_s": 20.0, "duration_s": 10.0}}, 20.0, 20.0),
        ({"hoisting": {"start_s": 20.0, "duration_s": 30.0}}, 20.0, 20.0),
        ({}, 20.0, 20.0),
    ],
)
def test_samples_during_an_unmodelled_profile_are_excluded(
    record: Callable[..., Observations], effects: EffectValues, from_s: float, to_s: float
) -> None:
    log = record({})
    inside = (log.time_s > from_s) & (log.time_s < to_s)
    on_edge = np.isclose(log.time_s, from_s) | np.isclose(log.time_s, to_s)

    assert np.array_equal(exclude_unmodelled_profiles(log, effects).used[~on_edge], (log.used & ~inside)[~on_edge])


@pytest.mark.slow
@pytest.mark.parametrize(("duration_s", "is_gust"), [(0.2, False), (3.0, True)])
def test_short_push_is_no_gust(context_of: ContextOf, duration_s: float, *, is_gust: bool) -> None:
    values: EffectValues = {
        "wind_gust": {"accel_m_s2": (0.4 / duration_s, 0.0), "start_s": 32.0, "duration_s": duration_s}
    }
    context = context_of(values)

    assert (make_candidate(context, values, context.fit(values)) is not None) == is_gust


@pytest.mark.slow
def test_event_and_persistent_effect_are_named_together(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    hidden: EffectValues = {"viscous_damping": {"damping_ratio": 0.01}, **IMPACT}
    result = reconcile(model, loaded(hidden), loaded(hidden, "held_out"))

    assert result.verdict == "named"
    assert {effect.name for effect in result.effects} == set(hidden)
