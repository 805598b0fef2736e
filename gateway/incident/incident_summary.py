"""The summary of an incident in plain sentences; every number stands in the recordings."""

from collections.abc import Iterator

from gateway.documents.format import format_fixed, format_percent, format_short
from gateway.incident.alert_incidents import STANDING, AlertIncident
from gateway.incident.course import Course
from gateway.incident.facts import CraneMove, IncidentFacts, PeakAngle
from gateway.incident.timeline_figure import ReportClock
from gateway.pipeline.alert_rules import SWING
from gateway.text import counted

MAX_SUMMARY_MARKS = 3
"""Marks in the summary; the events have all of them. Basis: a choice; the summary stays on one page, the events have all of
them."""
MAX_ALERT_SILENCE_S = 5.0
"""An alert is stated each second. Basis: after a longer silence the gateway has ended."""
LEVEL_WORDS = {"warn": "warning", "trip": "trip"}
CLOCKS = {
    "synchronised": "The gateway's clock was synchronised.",
    "free_running": "The gateway's clock was not synchronised: UTC is only as good as when it was last set.",
    "replayed": "The times are those of a replayed recording.",
}


def summary_sentences(course: Course, incident: AlertIncident | None, facts: IncidentFacts) -> tuple[str, ...]:
    """Return the sentences in the order in which a reader asks."""
    clock = ReportClock(course)
    return tuple(
        sentence
        for part in (
            _what_was_raised(course, clock, incident, facts),
            _how_large(clock, incident, facts),
            _what_went_before(clock, facts),
            _when_it_ended(course, clock, incident, facts),
            _how_good(course, facts),
        )
        for sentence in part
    )


def _what_was_raised(
    course: Course, clock: ReportClock, incident: AlertIncident | None, facts: IncidentFacts
) -> Iterator[str]:
    if incident is None or facts.raised_s is None:
        span = f"{clock.both(course.begin_s)} to {clock.both(course.end_s)}"
        yield f"No alert was raised in this time, {span}."
        return
    highest = incident.highest
    highest_s = (highest.time_ns - course.origin_ns) / 1e9
    limit = "" if highest.limit_deg is None else f" (limit {highest.limit_deg:.1f}°)"
    level = LEVEL_WORDS.get(highest.level, highest.level)
    if highest.event == STANDING:
        yield f"The {incident.rule} alert stood at {level}{limit} when the recordings begin, {clock.both(highest_s)}."
    else:
        yield f"The {incident.rule} alert was raised to {level}{limit} at {clock.both(highest_s)}."
    if highest_s - facts.raised_s > 0.05:
        first = LEVEL_WORDS.get(incident.changes[0].level, incident.changes[0].level)
        yield f"The incident began {highest_s - facts.raised_s:.1f} s before, with a {first}."
    if highest.is_bound and highest.value_deg is not None:
        yield (
            f"The {highest.value_deg:.1f}° that raised it were an upper bound, of a coming peak or of the angle at that "
            "time, which was estimated below the limit."
        )


def _how_large(clock: ReportClock, incident: AlertIncident | None, facts: IncidentFacts) -> Iterator[str]:
    if facts.peak is None:
        yield "The angle was not known at any time of it."
        return
    yield f"The largest angle between rope and vertical was {angle_text(facts.peak)} at {clock.both(facts.peak.time_s)}."
    if incident is None or incident.highest.limit_deg is None or incident.rule != SWING.name:
        return
    limit_deg, (low_deg, high_deg) = incident.highest.limit_deg, facts.peak.interval_deg
    highest_s = (incident.highest.time_ns - clock.course.origin_ns) / 1e9
    if facts.reached_s is not None:
        lead_s = facts.reached_s - highest_s
        when = f"{lead_s:.1f} s after the alert" if lead_s > 0.05 else "when the alert was raised"
        sure = "" if low_deg >= limit_deg else f"; the interval reaches down to {low_deg:.2f}°, so this is not certain"
        yield f"It reached the limit of {limit_deg:.1f}° {when}{sure}."
    elif high_deg < limit_deg:
        yield f"It did not reach the limit of {limit_deg:.1f}°: the alert came from an upper bound that was not reached."
    else:
        yield f"It may have reached the limit of {limit_deg:.1f}°: the interval of 95 % ends above it."


def _what_went_before(clock: ReportClock, facts: IncidentFacts) -> Iterator[str]:
    if facts.peak is None:
        return
    if not facts.moves:
        yield "In the 20 s before the peak neither the pivot nor the winch was seen to move, and no gust was seen."
    for move in facts.moves:
        yield f"Before the peak, {_move_text(move)} from {clock.time(move.begin_s)} to {clock.time(move.end_s)} UTC."


def _move_text(move: CraneMove) -> str:
    match move.state:
        case "driven":
            size = "" if move.pivot_m_s2 is None else f" by up to {format_short(abs(move.pivot_m_s2), 2)} m/s²"
            return f"trolley, bridge or jib accelerated the rope's upper end{size}"
        case "hoisting":
            size = "" if move.hoist_m_s is None else f" at up to {format_short(abs(move.hoist_m_s), 2)} m/s"
            return f"the winch {'lowered' if (move.hoist_m_s or 0) > 0 else 'hoisted'}{size}"
        case _:
            return "a gust pushed the load"


def _when_it_ended(
    course: Course, clock: ReportClock, incident: AlertIncident | None, facts: IncidentFacts
) -> Iterator[str]:
    if incident is None or facts.raised_s is None:
        return
    if facts.cleared_s is None:
        ended = (
            "the gateway was stopped or restarted" if course.end_s - facts.end_s > MAX_ALERT_SILENCE_S else "they end"
        )
        yield f"The recordings state no end of it: it stood at {clock.both(facts.end_s)}, after which {ended}."
    else:
        yield f"It cleared at {clock.both(facts.cleared_s)}, {facts.cleared_s - facts.raised_s:.1f} s after it began."
    yield _acknowledgement(course, clock, incident)
    for mark in course.marks[:MAX_SUMMARY_MARKS]:
        yield f"Mark at {clock.both(mark.time_s)}, by {mark.text}."


def _acknowledgement(course: Course, clock: ReportClock, incident: AlertIncident) -> str:
    known = incident.acknowledgement
    if known is None:
        return "The recordings state no acknowledgement of it."
    time_s = (known.time_ns - course.origin_ns) / 1e9
    reason = f", with the words: {known.reason}" if known.reason else ""
    return f"It was acknowledged at {clock.both(time_s)} by {known.acknowledged_by}{reason}."


def _how_good(course: Course, facts: IncidentFacts) -> Iterator[str]:
    samples = course.samples
    rate = "" if samples.rate_hz is None else f" at {format_short(samples.rate_hz, 4)} Hz"
    if samples.gaps:
        longest_s = max(gap.end_s - gap.begin_s for gap in samples.gaps)
        gaps = f"{counted(len(samples.gaps), 'gap')}, the longest {longest_s:.2f} s"
    else:
        gaps = "no gap"
    yield f"The report covers {samples.count} samples{rate}, with {gaps}, {samples.lost} lost and {samples.invalid} invalid."
    if facts.known_share is not None and facts.trusted_share is not None:
        known, trusted = format_percent(100 * facts.known_share), format_percent(100 * facts.trusted_share)
        yield f"The angle was known for {known} of the time, and the reading was trusted for {trusted}."
    qualities = list(dict.fromkeys(course.clock.state))
    yield from (CLOCKS[quality] for quality in qualities if quality in CLOCKS)
    if course.clock_steps_s:
        yield f"The wall clock stepped {len(course.clock_steps_s)} times; the times of this report do not step with it."


def angle_text(peak: PeakAngle) -> str:
    """Return the angle with its interval, and its direction."""
    low_deg, high_deg = peak.interval_deg
    decimals = 2 if high_deg - low_deg < 1 else 1
    angle, low, high = (format_fixed(each, decimals) for each in (peak.angle_deg, low_deg, high_deg))
    side = "" if peak.azimuth_deg is None else f", towards azimuth {format_fixed(peak.azimuth_deg, 0)}° of the housing,"
    return f"{angle}° ({low}° to {high}° at 95 %){side}"
