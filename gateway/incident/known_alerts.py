"""What the recordings say of the alerts at a time: one may have stood where nothing is recorded, or nobody judged."""

from collections.abc import Iterator
from itertools import chain, pairwise

from gateway.incident.course import MAX_ALERT_SILENCE_S, Course
from gateway.incident.sample_gaps import TimeGap


def unknown_times(course: Course) -> list[TimeGap]:
    """Return the times of a course of which it is not known whether an alert stood, each with its reason as a clause."""
    return sorted(_unknown(course), key=lambda each: each.begin_s)


def why_unknown(course: Course, time_s: float) -> str:
    """Return why it is not known whether an alert stood at a time; empty: it is known."""
    if time_s < course.begin_s:
        return f"it is before the first sample of this report; {course.begin_cause}"
    if time_s > course.end_s:
        return "it is behind the last sample of this report"
    return next((each.cause for each in unknown_times(course) if each.begin_s <= time_s <= each.end_s), "")


def _unknown(course: Course) -> Iterator[TimeGap]:
    off = [each for each in course.restarts if not each.unseen]
    for hole in course.holes:
        yield TimeGap(hole.begin_s, hole.end_s, f"no recording of that time is here ({hole.cause})")
    for restart in off:
        notice = "" if restart.is_announced else " without notice"
        yield TimeGap(restart.stopped_s, restart.started_s, f"the gateway had stopped{notice}")
    stated_s: list[float] = next((levels.time_s.tolist() for levels in course.alert_levels.values()), [])
    told = [*((each.begin_s, each.end_s) for each in course.holes), *((each.stopped_s, each.started_s) for each in off)]
    for begin_s, end_s in pairwise(sorted([course.begin_s, *stated_s, *chain.from_iterable(told), course.end_s])):
        is_told = any(from_s <= begin_s and end_s <= to_s for from_s, to_s in told)
        if end_s - begin_s > MAX_ALERT_SILENCE_S and not is_told:
            yield TimeGap(begin_s, end_s, "no message of that time on the alerts is here")
    for rule, levels in course.alert_levels.items():
        for begin_s, end_s, level in levels.spans(course.end_s):
            if level == "unknown" and end_s > course.begin_s:
                yield TimeGap(max(begin_s, course.begin_s), end_s, f"the level of the {rule} alert was not known")
