"""Trip, clear and hold as a table of cases."""

import math

import pytest

from gateway.stages.alerts import Limits, RuleState, event_between, initial_state, judge, overall_level

LIMITS = Limits(trip_rad=6.0, clear_rad=3.0, hold_s=2.0, warn_rad=4.0)

CASES: dict[str, tuple[list[tuple[float, float | None]], list[str]]] = {
    "below every limit stays normal": ([(0, 2), (1, 3.9)], ["normal", "normal"]),
    "the limit itself raises": ([(0, 4.0), (1, 6.0)], ["warn", "trip"]),
    "raised at once, from normal to trip": ([(0, 1), (1, 7)], ["normal", "trip"]),
    "a trip does not step down to warn": ([(0, 7), (1, 5), (9, 5)], ["trip", "trip", "trip"]),
    "cleared after hold below clear": ([(0, 7), (1, 2), (2, 2), (3, 2)], ["trip", "trip", "trip", "normal"]),
    "the hold begins again after a rise": (
        [(0, 7), (1, 2), (2, 3.5), (3, 2), (4.9, 2), (5, 2)],
        ["trip"] * 5 + ["normal"],
    ),
    "not known makes normal unknown": ([(0, 1), (1, None)], ["normal", "unknown"]),
    "not known never clears": ([(0, 7), (1, None), (60, None)], ["trip"] * 3),
    "not known restarts the hold": ([(0, 7), (1, 2), (2, None), (3, 2), (4.9, 2), (5, 2)], ["trip"] * 5 + ["normal"]),
    "known again after unknown": ([(0, None), (1, 1), (2, None), (3, 5)], ["unknown", "normal", "unknown", "warn"]),
}


@pytest.mark.parametrize("case", CASES)
def test_levels(case: str) -> None:
    readings, expected = CASES[case]
    state, levels = RuleState(), []
    for time_s, value_rad in readings:
        state = judge(state, value_rad, LIMITS, time_s)
        levels.append(state.level)
    assert levels == expected


def test_without_a_warn_limit_there_is_only_trip() -> None:
    limits = Limits(trip_rad=math.radians(3), clear_rad=math.radians(2.4), hold_s=0.0)
    assert judge(RuleState(), math.radians(2.9), limits, 0.0).level == "normal"
    assert judge(RuleState(), math.radians(3.0), limits, 0.0).level == "trip"


def test_since_is_the_time_of_the_last_change_of_level() -> None:
    state = judge(judge(RuleState(), 4.5, LIMITS, 10.0), 4.6, LIMITS, 11.0)
    assert state.since_s == 10.0


def test_unknown_ranks_between_normal_and_warn() -> None:
    assert overall_level(["normal", "unknown"]) == "unknown"
    assert overall_level(["unknown", "warn", "normal"]) == "warn"
    assert overall_level([]) == "unknown"


def test_events() -> None:
    assert event_between(RuleState("normal"), RuleState("trip")) == "raised"
    assert event_between(RuleState("warn"), RuleState("trip")) == "raised"
    assert event_between(RuleState("warn"), RuleState("normal")) == "cleared"
    assert event_between(RuleState("unknown"), RuleState("normal")) == "changed"
    assert event_between(RuleState("normal"), RuleState("unknown")) == "changed"
    assert event_between(RuleState("trip"), RuleState("trip")) == "standing"
    assert event_between(RuleState("warn"), RuleState("unknown")) == "changed"


def test_a_rule_judged_elsewhere_warns_while_it_is_active() -> None:
    raised = initial_state(RuleState("normal", 1.0), stands=True, time_s=5.0)
    assert (raised.level, raised.since_s) == ("warn", 5.0)
    assert initial_state(raised, stands=True, time_s=9.0) is raised
    assert initial_state(raised, stands=False, time_s=9.0) == RuleState("normal", 9.0)
    assert initial_state(RuleState("unknown", 1.0), stands=True, time_s=2.0).level == "warn"
