"""What moved the load before its largest angle: by the smoothed motion, or else by the gateway's live estimate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.errors import PlumblineError
from gateway.incident.course import Course
from gateway.incident.sample_gaps import TimeGap
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_GUST, IS_HOISTING
from gateway.numerics.array import Array
from gateway.stages.alerts import GRACE_S

CAUSE_BEFORE_S = 20.0
"""What moved within this time before the peak is stated as what went before it. Basis: three periods of a rope of 10 m."""
SMOOTHED_BEFORE_S, SMOOTHED_AFTER_S = 300.0, 20.0
"""The motion is smoothed from so long before the peak at most to so long after it. Basis: five minutes take some ten seconds; of
a simulated crane, a motion from 100 s before the peak on was doubted once in ten, and the same from 120 s on was not."""
MIN_MOVE_S = 0.5
"""A shorter state is left out of the sentences. Basis: five updates."""
KINDS = {"driven": IS_DRIVEN, "hoisting": IS_HOISTING, "wind": IS_GUST & ~IS_DRIVEN}
UNKNOWN = "unknown"
MOVES = ("driven", "hoisting", "wind", "driven_or_wind")
NOT_SMOOTHED = "the motion was not smoothed"
Spans = Sequence[tuple[float, float, str]]
"""(begin, end, state) each."""


@dataclass(frozen=True, slots=True)
class MotionAroundPeak:
    """The motion by all samples before and after each time, as `measure` states it."""

    origin_ns: int
    """Gateway time of the origin of its times."""
    history: MotionHistory
    doubt: str | None
    """Why it is unreliable; None: nothing speaks against it."""


SmoothMotion = Callable[[Path, int, int], MotionAroundPeak | None]
"""Takes a recording and two gateway times of it; None: the motion cannot be known. Raises `PlumblineError`."""


@dataclass(frozen=True, slots=True)
class CraneMove:
    """A time in which the pivot or the winch moved, or a gust pushed."""

    state: str
    """`driven_or_wind`: the live estimate took for a gust in the end what it had called a drive."""
    begin_s: float
    end_s: float
    pivot_m_s2: float | None
    """Largest horizontal acceleration of the pivot."""
    hoist_m_s: float | None
    """Largest rate of the rope's length, lowering positive."""
    probability: float | None
    """Mean probability that the estimate gives the state; None: by the live estimate."""


@dataclass(frozen=True, slots=True)
class LoadCauses:
    """What moved in the CAUSE_BEFORE_S before the peak."""

    moves: tuple[CraneMove, ...] = ()
    unseen_s: float = 0.0
    """How much of that time is not in the report, or has a motion that was not known."""
    unseen_causes: tuple[str, ...] = ()
    live_because: str | None = None
    """Why this is the gateway's live estimate; None: it is the smoothed motion."""


@dataclass(frozen=True, slots=True)
class _SeenMotion:
    """The motion of one of the two sources, in the times of the course."""

    spans: Spans
    time_s: Array
    pivot_m_s2: Array
    hoist_m_s: Array
    probabilities: Array | None = None


def load_causes(course: Course, peak_s: float, cut: Path | None, smooth: SmoothMotion | None) -> LoadCauses:
    """Return what moved the load before a peak; `cut` is the recording of the report, which `smooth` takes."""
    seen, live_because = _smoothed(course, peak_s, cut, smooth)
    if seen is None:
        motion = course.motion
        spans = motion.states.spans(course.end_s)
        seen = _SeenMotion(_undecided(spans), motion.time_s, motion.pivot_m_s2, motion.hoist_m_s)
    unseen_s, unseen_causes = _unseen(course, seen.spans, peak_s)
    return LoadCauses(_moves(seen, peak_s), unseen_s, unseen_causes, live_because)


def _smoothed(
    course: Course, peak_s: float, cut: Path | None, smooth: SmoothMotion | None
) -> tuple[_SeenMotion | None, str | None]:
    """Return the smoothed motion around a peak, or None and why not."""
    if cut is None or smooth is None:
        return None, NOT_SMOOTHED
    if len({str(each.rig) for each in course.configurations}) > 1:
        return None, "rope, housing or sensor were configured otherwise for a part of this time"
    begin_s, end_s = _smoothed_part(course, peak_s)
    try:
        found = smooth(cut, course.gateway_ns(begin_s), course.gateway_ns(end_s))
    except PlumblineError as error:
        return None, f"it cannot be smoothed: {error}"
    if found is None or found.doubt is not None:
        return None, "it cannot be smoothed" if found is None else f"the smoothed motion is unreliable: {found.doubt}"
    history, shift_s = found.history, course.time_s(found.origin_ns)
    phases = [(each.from_s + shift_s, each.to_s + shift_s, str(each.state)) for each in history.phases()]
    first_s = phases[0][0] if phases else end_s
    spans = [(course.begin_s, first_s, UNKNOWN), *phases] if first_s - course.begin_s >= MIN_MOVE_S else phases
    return _SeenMotion(
        spans,
        history.time_s + shift_s,
        history.pivot_acceleration_m_s2,
        history.hoist_m_s,
        history.probabilities,
    ), None


def _smoothed_part(course: Course, peak_s: float) -> tuple[float, float]:
    """Return begin and end of what is smoothed: no long gap breaks the motion in it, and one calibration is in force."""
    changed_s = [time_s for time_s, _ in course.calibrations[1:]]
    gaps = [gap for gap in course.hidden if gap.end_s - gap.begin_s > GRACE_S]
    begins_s = [*(gap.end_s for gap in gaps), *changed_s]
    ends_s = [*(gap.begin_s for gap in gaps), *changed_s]
    return (
        max([course.begin_s, peak_s - SMOOTHED_BEFORE_S, *(each for each in begins_s if each <= peak_s)]),
        min([course.end_s, peak_s + SMOOTHED_AFTER_S, *(each for each in ends_s if each >= peak_s)]),
    )


def _undecided(spans: Spans) -> list[tuple[float, float, str]]:
    """Return the live states, a drive that turns into a gust as either: the estimate corrected itself, for the same push."""
    found: list[tuple[float, float, str]] = []
    for from_s, to_s, state in spans:
        if found and state == "wind" and found[-1][2] == "driven" and from_s - found[-1][1] < MIN_MOVE_S:
            found[-1] = (found[-1][0], to_s, "driven_or_wind")
        else:
            found.append((from_s, to_s, state))
    return found


def _unseen(course: Course, spans: Spans, peak_s: float) -> tuple[float, tuple[str, ...]]:
    """Return how much of the time before the peak says nothing about its cause, and why."""
    begin_s = peak_s - CAUSE_BEFORE_S
    absent = [
        TimeGap(begin_s, course.begin_s, course.begin_cause),
        *course.hidden,
        *(TimeGap(from_s, to_s, "the motion was not known") for from_s, to_s, state in spans if state == UNKNOWN),
    ]
    found = sorted((each for each in absent if each.within_s(begin_s, peak_s) > 0), key=lambda gap: gap.begin_s)
    unseen_s, seen_until_s = 0.0, begin_s
    for each in found:  # they may overlap
        unseen_s += each.within_s(seen_until_s, peak_s)
        seen_until_s = max(seen_until_s, each.end_s)
    return unseen_s, tuple(dict.fromkeys(each.cause for each in found))


def _moves(seen: _SeenMotion, peak_s: float) -> tuple[CraneMove, ...]:
    """Return what moved before the peak, in order of time."""
    spans: list[tuple[float, float, str]] = []
    for from_s, to_s, state in seen.spans:
        if spans and spans[-1][2] == state and from_s - spans[-1][1] < MIN_MOVE_S:
            spans[-1] = (spans[-1][0], to_s, state)
        elif state in MOVES:
            spans.append((from_s, to_s, state))
    found = []
    for from_s, to_s, state in spans:
        begin_s, end_s = max(from_s, peak_s - CAUSE_BEFORE_S), min(to_s, peak_s)
        if end_s - begin_s >= MIN_MOVE_S:
            inside = (seen.time_s >= begin_s) & (seen.time_s <= end_s)
            probability = None
            if seen.probabilities is not None and state in KINDS:
                probability = float(seen.probabilities[inside][:, KINDS[state]].sum(axis=1).mean())
            pivot_m_s2 = _largest(np.hypot(*seen.pivot_m_s2[inside].T))
            found.append(CraneMove(state, begin_s, end_s, pivot_m_s2, _largest(seen.hoist_m_s[inside]), probability))
    return tuple(found)


def _largest(values: Array) -> float | None:
    """Return the value of the largest magnitude; None where none is known."""
    known = values[np.isfinite(values)]
    return float(known[np.argmax(np.abs(known))]) if len(known) else None
