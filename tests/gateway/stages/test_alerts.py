"""Trip, step-down, clear and hold as a table of cases."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.stages.alerts import (
    DECISION_FACTOR,
    GRACE_S,
    STEP_DOWN_SHARE,
    WAITING_FACTOR,
    Limits,
    Reading,
    RuleState,
    event_between,
    judge,
    judge_alarm,
    larger_reading,
    next_step,
    overall_level,
)

LIMITS = Limits(trip_rad=6.0, clear_rad=3.0, hold_s=2.0, warn_rad=4.0)
"""A trip steps down to a warning below 4.8."""
STEP_S = 0.5

CASES: dict[str, tuple[Sequence[float | None], list[str]]] = {
    "the first known value decides": ([None, 2], ["unknown", "normal"]),
    "before the first value nothing is normal": ([None] * 8, ["unknown"] * 8),
    "below every limit it stays normal": ([2, 3.9], ["normal", "normal"]),
    "the limit itself raises": ([4.0, 6.0], ["warn", "trip"]),
    "it is raised at once from normal to trip": ([1, 7], ["normal", "trip"]),
    "a warning stands between clear and warn": ([4.5] + [3.1] * 9, ["warn"] * 10),
    "a trip stands near its limit": ([7] + [5.41] * 9, ["trip"] * 10),
    "a trip steps down after the hold time": ([7] + [5.3] * 5, ["trip"] * 5 + ["warn"]),
    "the hold of the step down begins again after a rise": ([7, 4, 4, 5.5, 4, 4, 4, 4, 4], ["trip"] * 8 + ["warn"]),
    "after the step down it stands until it clears": (
        [7] + [3.5] * 8 + [2] * 5,
        ["trip"] * 5 + ["warn"] * 8 + ["normal"],
    ),
    "after the step down it is raised again at once": ([7] + [3.5] * 5 + [6], ["trip"] * 5 + ["warn", "trip"]),
    "a trip clears after the hold time without a warning": ([7] + [2] * 5, ["trip"] * 5 + ["normal"]),
    "the time of the step down counts for clearing": ([7, 4, 4] + [2] * 5, ["trip"] * 5 + ["warn"] * 2 + ["normal"]),
    "a warning clears after the hold time": ([5] + [2] * 5, ["warn"] * 5 + ["normal"]),
    "the hold begins again after a rise": ([5, 2, 2, 3.0, 2, 2, 2, 2, 2], ["warn"] * 8 + ["normal"]),
    "one unknown value leaves it normal": ([1, None, 1, None, None, 1], ["normal"] * 6),
    "after the grace time normal becomes unknown": ([1, None, None, None], ["normal"] * 3 + ["unknown"]),
    "from unknown a known value decides at once": (
        [1, None, None, None, 5, 2],
        ["normal"] * 3 + ["unknown", "warn", "warn"],
    ),
    "unknown is normal again at the first known value": (
        [1, None, None, None, 2],
        ["normal"] * 3 + ["unknown", "normal"],
    ),
    "unknown never clears a trip": ([7] + [None] * 99, ["trip"] * 100),
    "unknown never clears a warning": ([5] + [None] * 99, ["warn"] * 100),
    "an unknown value starts the hold anew": ([7, 2, 2, 2, None, 2, 2, 2, 2, 2], ["trip"] * 9 + ["normal"]),
    "an unknown value starts the hold of the step down anew": (
        [7, 4, 4, 4, None, 4, 4, 4, 4, 4],
        ["trip"] * 9 + ["warn"],
    ),
    "a trip clears after it was unknown": ([7] + [None] * 20 + [2] * 5, ["trip"] * 25 + ["normal"]),
    "a warning is raised to trip while values come and go": ([5, None, 7], ["warn", "warn", "trip"]),
    "a value that is not finite is unknown": ([7, math.nan, math.inf] + [math.nan] * 9, ["trip"] * 12),
    "an infinite value does not raise": ([1, math.inf], ["normal", "normal"]),
}


def levels(values_rad: Sequence[float | None], limits: Limits) -> list[str]:
    state = RuleState("unknown")
    found: list[str] = []
    for number, value_rad in enumerate(values_rad):
        state = judge(state, value_rad, limits, STEP_S * number)
        found.append(state.level)
    return found


@pytest.mark.parametrize("case", CASES)
def test_levels(case: str) -> None:
    values_rad, expected = CASES[case]
    assert levels(values_rad, LIMITS) == expected


def test_without_a_warn_limit_there_is_only_trip() -> None:
    limits = Limits(trip_rad=3.0, clear_rad=2.4, hold_s=0.0)
    assert levels([2.9, 3.0], limits) == ["normal", "trip"]


def test_without_a_warn_limit_a_trip_does_not_step_down() -> None:
    limits = Limits(trip_rad=3.0, clear_rad=1.0, hold_s=1.0)
    assert levels([3.0] + [1.5] * 9, limits) == ["trip"] * 10


def test_without_a_hold_time_a_trip_clears_at_the_first_value_below() -> None:
    limits = Limits(trip_rad=6.0, clear_rad=3.0, hold_s=0.0, warn_rad=4.0)
    assert levels([7, 4, 2], limits) == ["trip", "warn", "normal"]


def test_a_clear_level_above_the_step_down_clears_the_whole_alert() -> None:
    limits = Limits(trip_rad=6.0, clear_rad=5.8, hold_s=1.0, warn_rad=5.8)
    assert STEP_DOWN_SHARE * limits.trip_rad < 5.5
    assert levels([7, 5.5, 5.5, 5.5], limits) == ["trip"] * 3 + ["normal"]


def test_a_gap_between_values_starts_the_hold_anew() -> None:
    state = judge(RuleState("unknown"), 7.0, LIMITS, 0.0)
    state = judge(state, 2.0, LIMITS, 1.0)
    state = judge(state, 2.0, LIMITS, 1.0 + GRACE_S + 3600)
    assert state.level == "trip"
    assert judge(state, 2.0, LIMITS, state.known_s + 1.0).level == "trip"


def test_the_grace_time_begins_with_the_last_known_value() -> None:
    state = judge(RuleState("unknown"), 1.0, LIMITS, 10.0)
    assert judge(state, None, LIMITS, 10.0 + GRACE_S).level == "normal"
    assert judge(state, None, LIMITS, 10.1 + GRACE_S).level == "unknown"


def test_since_is_the_time_of_the_last_change_of_level() -> None:
    state = judge(judge(RuleState("unknown"), 4.5, LIMITS, 10.0), 4.6, LIMITS, 11.0)
    assert state.since_s == 10.0


def next_steps(values: Sequence[float | None], limits: Limits = LIMITS) -> list[Any]:
    """Level, the value below which it follows, and the time until then, after each value."""
    state = RuleState("unknown", 0.0)
    found: list[Any] = []
    for number, value in enumerate(values):
        state = judge(state, value, limits, number * STEP_S)
        step = next_step(state, limits)
        found.append(None if step is None else (step.level, step.below_rad, step.in_s))
    return found


def test_an_alert_says_what_follows_and_when() -> None:
    """The trip steps down below 5.4, the warning that is left clears below 3; each counts down its own hold time."""
    falls, ends = ("warn", pytest.approx(5.4)), ("normal", 3.0)
    assert next_steps([7, 5.5, 5.3, 5.3, 5.3, 5.3, 5.3]) == [
        (*falls, None),
        (*falls, None),
        *((*falls, in_s) for in_s in (2.0, 1.5, 1.0, 0.5)),
        (*ends, None),
    ]
    assert next_steps([7, 2, 2, 2, 2, 2]) == [(*falls, None), *((*ends, in_s) for in_s in (2.0, 1.5, 1.0, 0.5)), None]
    assert next_steps([7, 5, 2]) == [(*falls, None), (*falls, 2.0), (*falls, 1.5)]
    assert next_steps([4.5, 3.5, 2.9, 2.9, 3.1, 2.9]) == [(*ends, in_s) for in_s in (None, None, 2.0, 1.5, None, 2.0)]
    assert next_steps([7, 5, None, 5]) == [(*falls, in_s) for in_s in (None, 2.0, None, 2.0)]
    assert next_steps([1, 2, None]) == [None] * 3
    assert next_steps([7, 2, 2], replace(LIMITS, warn_rad=None)) == [(*ends, in_s) for in_s in (None, 2.0, 1.5)]


@given(
    st.lists(st.sampled_from([2.0, 2.9, 3.5, 5.0, 5.3, 5.45, 5.6, 7.0]), min_size=1, max_size=8),
    st.sampled_from([(4.0, 3.0), (5.7, 5.5)]),
)
def test_what_an_alert_says_comes_true_while_the_value_stays(values: list[float], levels: tuple[float, float]) -> None:
    limits, time_s = replace(LIMITS, warn_rad=levels[0], clear_rad=levels[1]), 0.0
    state = RuleState("unknown")
    for value in values:
        time_s += STEP_S
        state = judge(state, value, limits, time_s)
    step = next_step(state, limits)
    assert (step is None) == (state.level == "normal")
    if step is None:
        return
    assert (values[-1] < step.below_rad) == (step.in_s is not None)
    for after_s in np.arange(STEP_S, limits.hold_s if step.in_s is None else step.in_s, STEP_S):
        state = judge(state, values[-1], limits, time_s + after_s)
        assert state.level != step.level
    if step.in_s is not None:
        assert judge(state, values[-1], limits, time_s + step.in_s).level == step.level


def test_unknown_ranks_between_normal_and_warn() -> None:
    assert overall_level(["normal", "unknown"]) == "unknown"
    assert overall_level(["unknown", "warn", "normal"]) == "warn"
    assert overall_level([]) == "unknown"


def test_events() -> None:
    assert event_between(RuleState("normal"), RuleState("trip")) == "raised"
    assert event_between(RuleState("warn"), RuleState("trip")) == "raised"
    assert event_between(RuleState("unknown"), RuleState("warn")) == "raised"
    assert event_between(RuleState("trip"), RuleState("warn")) == "changed"
    assert event_between(RuleState("warn"), RuleState("normal")) == "cleared"
    assert event_between(RuleState("unknown"), RuleState("normal")) == "changed"
    assert event_between(RuleState("normal"), RuleState("unknown")) == "changed"
    assert event_between(RuleState("trip"), RuleState("trip")) == "standing"
    assert event_between(RuleState("warn"), RuleState("unknown")) == "changed"


def test_an_alarm_warns_while_it_is_active() -> None:
    raised = judge_alarm(RuleState("normal", 1.0), is_active=True, time_s=5.0)
    assert (raised.level, raised.since_s) == ("warn", 5.0)
    assert judge_alarm(raised, is_active=True, time_s=9.0) is raised
    assert judge_alarm(raised, is_active=False, time_s=9.0) == RuleState("normal", 9.0)
    assert judge_alarm(RuleState("unknown", 1.0), is_active=True, time_s=2.0).level == "warn"


def test_the_larger_reading_is_the_present_angle_or_the_coming_peak() -> None:
    present, low, high = Reading(0.03), Reading(0.02, 1.5), Reading(0.05, 1.8)
    assert larger_reading(present, None) == present
    assert larger_reading(present, low) == present
    assert larger_reading(present, high) == replace(high, present=present)
    assert larger_reading(present, Reading(0.03, 2.0)) == present


def test_without_the_present_angle_there_is_no_larger_reading() -> None:
    assert larger_reading(None, None) is None
    assert larger_reading(None, Reading(0.02, 1.5)) is None


def test_the_later_a_peak_comes_the_less_its_uncertainty_counts() -> None:
    at_present = Reading.of(0.05, 0.02)
    assert at_present.value_rad == pytest.approx(0.05 + DECISION_FACTOR * 0.02)
    soon, late = Reading.of(0.05, 0.02, 1.0, period_s=8.0), Reading.of(0.05, 0.02, 4.0, period_s=8.0)
    assert soon.value_rad == pytest.approx(0.05 + (DECISION_FACTOR - WAITING_FACTOR / 8) * 0.02)
    assert late.value_rad == 0.05  # never less than the best estimate
    assert late.upper_rad > at_present.value_rad
