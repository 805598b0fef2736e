"""What lasts is found before an event that hides it; then the event beside it."""

from collections.abc import Callable

import numpy as np
import pytest

from gateway.twin.effects.parameter import Value, Values
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.changepoints.changepoint import locate_next_changepoint, longest_consistent_prefix
from gateway.twin.reconcile.changepoints.changepoint_scan import exclude_unmodelled_profiles
from gateway.twin.reconcile.changepoints.pre_event_candidates import effects_extending_consistent_prefix
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import make_candidate
from gateway.twin.reconcile.search.score_test import scorable_effects

SettingOf = Callable[[EffectValues], FitContext]

HOIST: EffectValues = {"hoisting": {"speed_m_s": -0.15, "start_s": 32.0, "duration_s": 6.0}}
BLOW: EffectValues = {"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 32.3}}
WIND: EffectValues = {"steady_wind": {"accel_m_s2": (0.15, -0.1)}}


@pytest.fixture
def setting_of(rig: TwinRig, record: Callable[..., Observations]) -> SettingOf:
    return lambda effects: FitContext(rig, {}, record(effects), lambda: None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("viscous_damping", "damping_ratio", 0.01),
        ("axis_offset", "offset_g", (0.01, -0.01, 0.01)),
        ("clock_drift", "relative", 0.015),
    ],
)
@pytest.mark.parametrize(("event", "begins_s"), [(HOIST, 32.0), (BLOW, 32.3)])
def test_what_acts_all_the_time_is_first_on_the_beginning_with_its_value(
    setting_of: SettingOf, name: str, parameter: str, value: Value, event: EffectValues, begins_s: float
) -> None:
    setting = setting_of({name: {parameter: value}, **event})
    first = effects_extending_consistent_prefix(setting, {}, scorable_effects(setting))[0]

    assert set(first.values) == {name}
    assert np.asarray(first.values[name][parameter]) == pytest.approx(np.asarray(value), rel=0.15)
    assert setting.log.time_s[first.end_sample] == pytest.approx(begins_s, abs=0.8)


@pytest.mark.slow
@pytest.mark.parametrize("effects", [HOIST, BLOW, {}])
def test_no_lasting_effect_is_proposed_where_the_motion_was_free_until_the_event(
    setting_of: SettingOf, effects: EffectValues
) -> None:
    setting = setting_of(effects)

    assert effects_extending_consistent_prefix(setting, {}, scorable_effects(setting)) == []


def test_a_small_effect_does_not_carry_the_beginning_past_an_event(setting_of: SettingOf) -> None:
    setting = setting_of({"viscous_damping": {"damping_ratio": 0.002}, **BLOW})
    begun = longest_consistent_prefix(setting, {"viscous_damping": {}})

    assert begun is not None
    assert setting.log.time_s[begun.end_sample] == pytest.approx(32.3, abs=0.8)


@pytest.mark.slow
def test_the_end_is_found_though_a_wind_seems_to_turn_with_the_housing(setting_of: SettingOf) -> None:
    setting = setting_of({**WIND, **HOIST})
    begun = longest_consistent_prefix(setting, {"steady_wind": {}})
    assert begun is not None
    found = locate_next_changepoint(setting, begun, length=True)

    assert found is not None
    assert (found.from_s, found.to_s) == pytest.approx((32.0, 38.0), abs=0.8)
    assert found.remaining_chi2 < 1.1 * setting.log.n_values


@pytest.mark.slow
def test_a_clock_does_not_make_up_for_a_rope_that_became_another(setting_of: SettingOf) -> None:
    setting = setting_of({"clock_drift": {"relative": 0.015}, **HOIST})
    begun = longest_consistent_prefix(setting, {"clock_drift": {}})

    assert begun is not None
    assert locate_next_changepoint(setting, begun, length=False) is None
    assert locate_next_changepoint(setting, begun, length=True) is not None


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
def test_samples_of_an_event_with_a_course_of_its_own_are_left_out(
    record: Callable[..., Observations], effects: dict[str, dict[str, float]], from_s: float, to_s: float
) -> None:
    log = record({})
    inside = (log.time_s > from_s) & (log.time_s < to_s)
    on_edge = np.isclose(log.time_s, from_s) | np.isclose(log.time_s, to_s)

    assert np.array_equal(exclude_unmodelled_profiles(log, effects).used[~on_edge], (log.used & ~inside)[~on_edge])


@pytest.mark.slow
@pytest.mark.parametrize(("duration_s", "is_one"), [(0.2, False), (3.0, True)])
def test_a_push_that_is_over_at_once_is_no_gust(setting_of: SettingOf, duration_s: float, is_one: bool) -> None:
    gust: Values = {"accel_m_s2": (0.4 / duration_s, 0.0), "start_s": 32.0, "duration_s": duration_s}
    values: EffectValues = {"wind_gust": gust}
    setting = setting_of(values)

    assert (make_candidate(setting, values, setting.fit(values)) is not None) == is_one


@pytest.mark.slow
@pytest.mark.parametrize("event", [HOIST, BLOW])
def test_an_event_beside_what_acts_all_the_time_is_named_with_it(
    model: Model, loaded: Callable[..., CheckedRecording], event: EffectValues
) -> None:
    hidden = {"viscous_damping": {"damping_ratio": 0.01}, **event}
    answer = reconcile(model, loaded(hidden), loaded(hidden, "held_out"))

    assert answer.verdict == "named"
    assert {effect.name for effect in answer.effects} == set(hidden)
