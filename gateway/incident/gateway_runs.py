"""The runs of a gateway in an incident: which message is of which, and for how long nobody judged between two of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf

import numpy as np

from gateway.incident.sample_gaps import RECORDINGS_END, TimeGap
from gateway.numerics.array import Array

HolesS = Sequence[tuple[float, float]]
HELD_S = 2.0
"""So long a state lasts that is stated in a hole. Basis: two periods of the clock, the only state that the quota leaves there."""


@dataclass(frozen=True, slots=True)
class StateCourse:
    """A state in words, from each of its messages until the next, and no longer than the recordings go on without a hole.

    The run of the gateway that stated it ends it, too.
    """

    time_s: Array
    until_s: Array
    """The latest end of the state of each message; infinite where nothing ends it."""
    state: tuple[str, ...]

    def spans(self, end_s: float) -> list[tuple[float, float, str]]:
        """Return (begin, end, state) without repetitions."""
        found: list[tuple[float, float, str]] = []
        for index, (begin_s, state) in enumerate(zip(self.time_s.tolist(), self.state, strict=True)):
            following_s = float(self.time_s[index + 1]) if index + 1 < len(self.state) else max(end_s, begin_s)
            to_s = min(following_s, float(self.until_s[index]))
            if found and found[-1][1:] == (begin_s, state):
                found[-1] = (found[-1][0], to_s, state)
            else:
                found.append((begin_s, to_s, state))
        return found

    def share_of(self, state: str, end_s: float) -> float | None:
        """Return the share of the time in which a state lasted; None where no state is known."""
        spans = self.spans(end_s)
        total_s = sum(end - begin for begin, end, _ in spans)
        return sum(end - begin for begin, end, each in spans if each == state) / total_s if total_s > 0 else None


@dataclass(slots=True)
class GatewayRun:
    """A run from its first to its last message."""

    boot_id: str
    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class GatewayRestart:
    """The end of a run and the beginning of the next one."""

    stopped_s: float
    """Time of the last message that is on the disk."""
    started_s: float
    is_announced: bool
    """The gateway had stated that it was stopping."""
    judged_s: float | None
    """Time from which on every alert rule was judged again; None: not before the run or the course ends."""
    unseen: str
    """Why the recordings have a hole between the two, so that when the gateway stopped is not known; empty: they have none."""
    hole: TimeGap | None = None
    """What is not in the recordings between the start and `judged_s`, so that whether alerts were judged is not known there."""


@dataclass(slots=True)
class RunRegister:
    """Takes the times of all messages in the order of writing."""

    runs: list[GatewayRun] = field(default_factory=list)

    def add(self, time_s: float, boot_id: str) -> None:
        """Take the time of a message of a run."""
        if not self.runs or self.runs[-1].boot_id != boot_id:
            self.runs.append(GatewayRun(boot_id, time_s, time_s))
        self.runs[-1].end_s = max(self.runs[-1].end_s, time_s)

    def states(self, time_s: Array, states: tuple[str, ...], holes_s: HolesS = ()) -> StateCourse:
        """Return the course of a state whose times ascend; `holes_s`: begin and end of what is not in the recordings."""
        ends_s = sorted([*(run.end_s for run in self.runs[:-1]), *(begin_s for begin_s, _ in holes_s)])
        until_s = [
            each + HELD_S
            if any(begin_s < each < end_s for begin_s, end_s in holes_s)
            else next((end_s for end_s in ends_s if end_s >= each), inf)
            for each in time_s.tolist()
        ]
        return StateCourse(time_s, np.array(until_s, dtype=np.float64), states)

    def restarts(
        self, health: StateCourse, alert_levels: Mapping[str, StateCourse], gaps: Sequence[TimeGap]
    ) -> tuple[GatewayRestart, ...]:
        """Return the restarts in order of time; `gaps`: the times without samples."""
        holes = [gap for gap in gaps if gap.is_hole and gap.cause != RECORDINGS_END]
        return tuple(_restart(health, alert_levels, holes, before, after) for before, after in pairwise(self.runs))


def _restart(
    health: StateCourse,
    alert_levels: Mapping[str, StateCourse],
    holes: Sequence[TimeGap],
    before: GatewayRun,
    after: GatewayRun,
) -> GatewayRestart:
    judged_s = _judged_s(alert_levels, after)
    until_s = after.end_s if judged_s is None else judged_s
    unseen = next((hole.cause for hole in holes if hole.within_s(before.end_s, after.begin_s) > 0), "")
    inside = next((hole for hole in holes if hole.within_s(after.begin_s, until_s) > 0), None)
    is_announced = _last_state(health, before) == "stopping"
    return GatewayRestart(before.end_s, after.begin_s, is_announced, judged_s, unseen, inside)


def _last_state(states: StateCourse, run: GatewayRun) -> str | None:
    inside = np.flatnonzero((states.time_s >= run.begin_s) & (states.time_s <= run.end_s))
    return states.state[int(inside[-1])] if len(inside) else None


def _judged_s(alert_levels: Mapping[str, StateCourse], run: GatewayRun) -> float | None:
    """Return the time of a run from which on no rule is unknown that was not judged at its begin."""
    first_s = []
    for levels in alert_levels.values():
        inside = np.flatnonzero((levels.time_s >= run.begin_s) & (levels.time_s <= run.end_s))
        known = [index for index in inside.tolist() if levels.state[index] != "unknown"]
        if not known:
            return None
        first_s.append(float(levels.time_s[known[0]]))
    return max(first_s, default=None)
