"""The alert rules: trip, step-down, clear and hold, with the time as an argument. An unknown value has a level of its own."""

import math
from dataclasses import dataclass, replace

from gateway.messages import LEVEL_RANK, AlertEventKind, Level
from gateway.numerics.stats import NORMAL_975

STEP_DOWN_SHARE = 0.9
"""Share of the trip level below which a trip steps down to a warning after the hold time; unit 1. Basis: on simulated cranes a
sixth fewer trips without cause than with 0.8, and 1 % fewer exceedances announced."""
GRACE_S = 1.0
"""Longest time without a known value in which a rule stays normal. Basis: ten updates; one missed update is no loss of sight."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The levels at which a rule is raised and cleared."""

    trip_rad: float
    clear_rad: float
    hold_s: float
    warn_rad: float | None = None


DECISION_FACTOR = 0.75
"""Standard uncertainties above the best estimate at which an angle is compared with its limits: one-sided confidence 77 %. Basis:
on simulated cranes (docs/evidence/motion.md, alerts) the knee of announced exceedances against trips without cause."""
WAITING_FACTOR = 2.0
"""By how much that falls per period until a coming peak, down to none: what is expected late can be decided later, when it is
better known. Basis: on 63 simulated cranes an eighth fewer trips without cause than with half an uncertainty everywhere, and 2 %
more exceedances announced."""


def decision_factor(in_periods: float, at_present: float = DECISION_FACTOR) -> float:
    """Return the standard uncertainties that count of an angle expected after so many periods of the swing."""
    return max(at_present - WAITING_FACTOR * in_periods, 0.0)


@dataclass(frozen=True, slots=True)
class Reading:
    """An angle as it is compared with its limits: the best estimate and a share of its uncertainty."""

    value_rad: float
    expected_in_s: float = 0.0
    """Time until the angle is reached: that of a coming peak, 0 for the present angle."""
    estimate_rad: float | None = None
    """Best estimate of the same angle; None: the value itself."""
    present: "Reading | None" = None
    """The reading of the present angle, where this one is that of a coming peak."""
    u_rad: float = 0.0
    """Standard uncertainty of the angle."""

    @classmethod
    def of(cls, angle_rad: float, u_rad: float, expected_in_s: float = 0.0, period_s: float = math.inf) -> "Reading":
        """Return the reading of an angle with its standard uncertainty; `period_s`: of the swing."""
        factor = decision_factor(expected_in_s / period_s)
        return cls(angle_rad + factor * u_rad, expected_in_s, angle_rad, u_rad=u_rad)

    @property
    def upper_rad(self) -> float:
        """Upper end of the 95 % interval."""
        return max(self.value_rad, self.best_rad + NORMAL_975 * self.u_rad)

    @property
    def best_rad(self) -> float:
        """Best estimate of the angle."""
        return self.value_rad if self.estimate_rad is None else self.estimate_rad

    @property
    def now(self) -> "Reading":
        """The reading of the present angle."""
        return self if self.present is None else self.present

    def is_bound(self, limit_rad: float) -> bool:
        """Return whether a limit is reached by a bound at most: the best estimate of the present angle is below it."""
        return self.now.best_rad < limit_rad


def larger_reading(present: Reading | None, peak: Reading | None) -> Reading | None:
    """Return the larger of the present reading and the coming peak; None where the present angle is not known."""
    if present is None or peak is None or peak.value_rad <= present.value_rad:
        return present
    return replace(peak, present=present)


@dataclass(frozen=True, slots=True)
class RuleState:
    """The state of a rule."""

    level: Level
    since_s: float = 0.0
    known_s: float = -math.inf
    """Time of the last known value."""
    below_clear_since_s: float | None = None
    below_step_down_since_s: float | None = None


def judge(
    state: RuleState, value_rad: float | None, limits: Limits, time_s: float, *, is_untrusted: bool = False
) -> RuleState:
    """Return the next state of a rule; `value_rad` is the angle as it is compared, None where it is not known.

    A rule is raised at once, and a known value decides at once where the level was unknown. It clears after the value has been
    below the clear level for hold_s. A trip of a rule with a warn level steps down to a warning after the value has been below
    STEP_DOWN_SHARE of the trip level for hold_s. An unknown value keeps a warning or a trip and starts the hold anew; it makes a
    normal rule unknown after the grace time. A value that is not trusted can raise a rule and starts the hold anew.
    """
    if value_rad is None or not math.isfinite(value_rad):
        return _judge_unknown(state, time_s)
    if time_s - state.known_s > GRACE_S:
        state = _without_hold(state)
    lowering_rad = math.inf if is_untrusted else value_rad
    clear_since_s = _below_since(lowering_rad, limits.clear_rad, state.below_clear_since_s, time_s)
    step_down_rad = STEP_DOWN_SHARE * limits.trip_rad
    step_down_since_s = _below_since(lowering_rad, step_down_rad, state.below_step_down_since_s, time_s)
    level = _level_of(value_rad, limits)
    if state.level != "unknown" and LEVEL_RANK[level] <= LEVEL_RANK[state.level]:
        level = state.level
        if _is_held(clear_since_s, limits, time_s):
            level = "normal"
        elif level == "trip" and limits.warn_rad is not None and _is_held(step_down_since_s, limits, time_s):
            level = "warn"
    since_s = state.since_s if level == state.level else time_s
    return RuleState(level, since_s, time_s, clear_since_s, step_down_since_s)


def _judge_unknown(state: RuleState, time_s: float) -> RuleState:
    if state.level == "normal" and time_s - state.known_s > GRACE_S:
        return RuleState("unknown", time_s, state.known_s)
    return _without_hold(state)


def _without_hold(state: RuleState) -> RuleState:
    return replace(state, below_clear_since_s=None, below_step_down_since_s=None)


def _below_since(value_rad: float, level_rad: float, since_s: float | None, time_s: float) -> float | None:
    """Return the time since which the value has been below a level; None where it is not below."""
    if value_rad >= level_rad:
        return None
    return time_s if since_s is None else since_s


def _is_held(since_s: float | None, limits: Limits, time_s: float) -> bool:
    return since_s is not None and time_s - since_s >= limits.hold_s


def _level_of(value_rad: float, limits: Limits) -> Level:
    if value_rad >= limits.trip_rad:
        return "trip"
    if limits.warn_rad is not None and value_rad >= limits.warn_rad:
        return "warn"
    return "normal"


@dataclass(frozen=True, slots=True)
class NextStep:
    """What follows a warning or a trip."""

    level: Level
    below_rad: float
    """Level below which the value must stay for the hold time."""
    in_s: float | None
    """Time until then, from the last known value, if the value stays as low as it is; None: it is not low enough."""


def next_step(state: RuleState, limits: Limits) -> NextStep | None:
    """Return what follows a warning or a trip, of the steps that `judge` takes the first one; None: neither stands."""
    if state.level not in ("warn", "trip"):
        return None
    steps = [_step("normal", limits.clear_rad, state.below_clear_since_s, state, limits)]
    if state.level == "trip" and limits.warn_rad is not None:
        step_down_rad = STEP_DOWN_SHARE * limits.trip_rad
        steps.append(_step("warn", step_down_rad, state.below_step_down_since_s, state, limits))
    if all(step.in_s is None for step in steps):
        return max(steps, key=lambda step: step.below_rad)
    return min(steps, key=lambda step: math.inf if step.in_s is None else step.in_s)  # normal where both are due


def _step(level: Level, below_rad: float, since_s: float | None, state: RuleState, limits: Limits) -> NextStep:
    in_s = None if since_s is None else max(0.0, since_s + limits.hold_s - state.known_s)
    return NextStep(level, below_rad, in_s)


def judge_alarm(state: RuleState, *, is_active: bool, time_s: float) -> RuleState:
    """Return the next state of a rule whose alarm another stage decides, with its own hold time: a warning while it is active."""
    level: Level = "warn" if is_active else "normal"
    return state if state.level == level else RuleState(level, time_s)


def overall_level(levels: list[Level]) -> Level:
    """Return the level that an operator must react to first."""
    return max(levels, key=lambda level: LEVEL_RANK[level], default="unknown")


def event_between(before: RuleState, after: RuleState) -> AlertEventKind:
    """Return the event between two states: raised, cleared, or changed (a step down, or between known and unknown)."""
    if before.level == after.level:
        return "standing"
    if after.level in ("warn", "trip"):
        return "raised" if LEVEL_RANK[after.level] > LEVEL_RANK[before.level] else "changed"
    return "cleared" if after.level == "normal" and before.level in ("warn", "trip") else "changed"
