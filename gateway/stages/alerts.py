"""The alert rules: trip, clear and hold, with the time as an argument. A value that is not known has a level of its own."""

from dataclasses import dataclass, replace
from typing import Literal

from gateway.messages import Level

Event = Literal["raised", "changed", "cleared", "standing"]
RANK: dict[Level, int] = {"normal": 0, "unknown": 1, "warn": 2, "trip": 3}


@dataclass(frozen=True, slots=True)
class Limits:
    """The levels at which a rule is raised and cleared."""

    trip_rad: float
    clear_rad: float
    hold_s: float
    warn_rad: float | None = None


@dataclass(frozen=True, slots=True)
class RuleState:
    """The state of a rule."""

    level: Level = "normal"
    since_s: float = 0.0
    below_since_s: float | None = None
    """Time since which the value has been below the clear level."""


def judge(state: RuleState, value_rad: float | None, limits: Limits, time_s: float) -> RuleState:
    """Return the next state of a rule; `value_rad` is an upper confidence limit, None where it is not known.

    A rule is raised at once. It is cleared only after the value has been below the clear level for hold_s. A value that is not
    known neither raises nor clears an alert, and makes a normal rule unknown.
    """
    if value_rad is None:
        if state.level == "normal":
            return RuleState("unknown", time_s)
        return _without_hold(state)
    asked = _level_of(value_rad, limits)
    if RANK[asked] > RANK[state.level] or state.level == "unknown":
        return RuleState(asked, time_s)
    if state.level == "normal" or value_rad >= limits.clear_rad:
        return _without_hold(state)
    below_since_s = time_s if state.below_since_s is None else state.below_since_s
    if time_s - below_since_s >= limits.hold_s:
        return RuleState("normal", time_s)
    return replace(state, below_since_s=below_since_s)


def initial_state(state: RuleState, *, stands: bool, time_s: float) -> RuleState:
    """Return the next state of a rule that is judged elsewhere, including its hold time: a warning while `stands` is true."""
    level: Level = "warn" if stands else "normal"
    return state if state.level == level else RuleState(level, time_s)


def _without_hold(state: RuleState) -> RuleState:
    return state if state.below_since_s is None else replace(state, below_since_s=None)


def _level_of(value_rad: float, limits: Limits) -> Level:
    if value_rad >= limits.trip_rad:
        return "trip"
    if limits.warn_rad is not None and value_rad >= limits.warn_rad:
        return "warn"
    return "normal"


def overall_level(levels: list[Level]) -> Level:
    """Return the level that an operator must react to first."""
    return max(levels, key=lambda level: RANK[level], default="unknown")


def event_between(before: RuleState, after: RuleState) -> Event:
    """Return the event between two states: raised, cleared, or changed between known and unknown."""
    if before.level == after.level:
        return "standing"
    if after.level in ("warn", "trip"):
        return "raised" if RANK[after.level] > RANK[before.level] else "changed"
    return "cleared" if after.level == "normal" and before.level in ("warn", "trip") else "changed"
