"""An incident in words: its summary in plain sentences, whose numbers all stand in the recordings."""

from collections.abc import Iterator, Sequence
from math import inf

from gateway.documents.format import (
    as_sentence,
    format_fixed,
    format_limit,
    format_percent,
    format_short,
    printable_text,
)
from gateway.errors import counted, first_of
from gateway.incident.angle_sentences import LEVEL_WORDS, MAX_SUMMARY_RISES, angle_sentences
from gateway.incident.cause_sentences import cause_sentences
from gateway.incident.course import MAX_ALERT_SILENCE_S, Course
from gateway.incident.facts import IncidentFacts
from gateway.incident.gateway_runs import GatewayRestart
from gateway.incident.incident_selection import AlertIncident, IncidentChange, IncidentWindow
from gateway.incident.known_alerts import unknown_times, why_unknown
from gateway.incident.setting_changes import MAX_WORDS_CHARACTERS, SettingChange
from gateway.incident.timeline_figure import ReportClock

MAX_SUMMARY_MARKS = 3
"""Marks in the summary; the events have all of them. Basis: a choice; the summary stays on one page, the events have all of
them."""
MAX_SUMMARY_RESTARTS = 3
"""Restarts in the summary. Basis: as of the marks."""
MAX_SUMMARY_OTHERS = 3
"""Other incidents in the summary. Basis: as of the marks."""
STOOD_WORDS = {
    "warn": "while it stood at warning",
    "trip": "while it stood at trip",
    "unknown": "while its level was not known",
}
CLOCKS = {
    "synchronised": "The gateway's clock was synchronised.",
    "free_running": "The gateway's clock was not synchronised: UTC is only as good as when it was last set.",
    "replayed": "The times are those of a replayed recording.",
}
SOURCE_SENTENCES = {
    "SIMULATION": "SIMULATION: this crane is simulated; no load has moved.",
    "REPLAY": "REPLAY: these samples were recorded before, and played to the gateway again.",
}


def summary_sentences(
    course: Course, incident: AlertIncident | None, facts: IncidentFacts, window: IncidentWindow | None = None
) -> tuple[str, ...]:
    """Return the sentences in the order in which a reader asks; without the window of the report, of the incident alone."""
    clock = ReportClock(course)
    source = [SOURCE_SENTENCES[course.source]] if course.source else []
    asked = _what_was_asked(clock, incident, window)
    others = () if window is None else _which_others_were(clock, window.others, window.hidden)
    if incident is not None and incident.is_acknowledgement_alone:
        return (*source, *asked, *_what_is_left_of_it(clock, incident), *others)
    return tuple(
        sentence
        for part in (
            source,
            asked,
            _where_they_begin(course, clock, incident),
            _what_was_raised(course, clock, incident, facts),
            which_settings_were_changed(course, clock, incident),
            angle_sentences(clock, incident, facts),
            cause_sentences(clock, facts),
            _when_it_ended(course, clock, incident, facts),
            others,
            _which_calibrations_changed(course, clock, facts),
            suspension_texts(course, clock),
            _when_it_was_restarted(course, clock),
            _how_good(course, facts),
        )
        for sentence in part
    )


def _what_was_asked(clock: ReportClock, incident: AlertIncident | None, window: IncidentWindow | None) -> Iterator[str]:
    """Yield what is known of the time that was asked for, where the report is of an incident near it, or of none."""
    if window is None or window.asked_ns is None:
        return
    asked_s = clock.course.time_s(window.asked_ns)
    asked, why = f"{clock.both(asked_s)}, the time that was asked for,", why_unknown(clock.course, asked_s)
    if why:
        yield f"Whether an alert stood at {asked} is not known: {why}."
    if incident is None:
        return
    near = _how_near(clock.course, incident, asked_s)
    if why:
        yield f"The nearest one that is known {near}, and this report is of it."
    else:
        which = "the next one" if asked_s < clock.course.time_s(incident.raised_ns) else "the one before"
        yield f"At {asked} no alert stood; {which} {near}, and this report is of it."


def _what_is_left_of_it(clock: ReportClock, incident: AlertIncident) -> Iterator[str]:
    """Yield what the recordings have of an incident of which they have no more than an acknowledgement."""
    run = clock.course.last_health
    where = "not" if run is None or incident.id.startswith(f"{run.boot_id}-") else "in a run that is not"
    yield (
        f"Of incident {incident.id} only an acknowledgement is in these files ({_acknowledged_texts(clock, incident)}); "
        f"the alert itself is {where}. Its level, times and angle are not known."
    )


def _acknowledged_texts(clock: ReportClock, incident: AlertIncident) -> str:
    """Return when and by whom an incident was acknowledged."""
    return "; ".join(
        f"{clock.both(clock.course.time_s(each.time_ns))}, {each.acknowledged_by or 'an unnamed person'}"
        for each in incident.acknowledgements[-MAX_SUMMARY_MARKS:]
    )


def _how_near(course: Course, incident: AlertIncident, time_s: float) -> str:
    """Return how long after a time an incident began, or how long before it it had ended, as far as that is recorded."""
    raised_s, last_s = course.time_s(incident.raised_ns), course.time_s(incident.last_ns)
    if incident.is_acknowledgement_alone:
        when = "later" if time_s < raised_s else "earlier"
        return f"was acknowledged {format_fixed(abs(raised_s - time_s), 1)} s {when}"
    if time_s < raised_s:
        began = "was first stated" if incident.is_raised_before else "began"
        return f"{began} {format_fixed(raised_s - time_s, 1)} s later"
    ended = "was last stated" if incident.cleared_ns is None else "had ended"
    return f"{ended} {format_fixed(time_s - last_s, 1)} s earlier"


def _where_they_begin(course: Course, clock: ReportClock, incident: AlertIncident | None) -> Iterator[str]:
    """Yield what is missing before the first message of an incident that was raised before it."""
    if incident is None or not incident.is_raised_before:
        return
    first_s = course.time_s(incident.changes[0].time_ns)
    gaps = [each for each in course.samples.gaps if each.end_s <= first_s]
    if gaps:
        begin_s, cause = gaps[-1].end_s, gaps[-1].cause
        yield f"The recordings go on at {clock.both(begin_s)}; what was before: {cause} (from {clock.time(gaps[-1].begin_s)} on)."
    else:
        yield f"The recordings begin at {clock.both(course.begin_s)}; what was before: {course.begin_cause}."


def _what_was_raised(
    course: Course, clock: ReportClock, incident: AlertIncident | None, facts: IncidentFacts
) -> Iterator[str]:
    if incident is None or facts.raised_s is None:
        span = f"{clock.both(course.begin_s)} to {clock.both(course.end_s)}"
        unknown = [
            f"from {clock.time(each.begin_s)} to {clock.time(each.end_s)} UTC ({each.cause})"
            for each in unknown_times(course)
        ]
        if unknown:
            yield f"The recordings state no alert in this time, {span}; whether one stood is not known {first_of(unknown, 3)}."
        else:
            yield f"No alert was raised in this time, {span}."
        return
    highest = incident.highest
    highest_s = course.time_s(highest.time_ns)
    higher = "" if highest.level == "trip" else ", and may have stood higher before"
    limit = "" if highest.limit_deg is None else f" (limit {format_limit(highest.limit_deg)}°)"
    level = LEVEL_WORDS.get(highest.level, highest.level)
    if highest.level not in LEVEL_WORDS:
        yield f"Of the {incident.rule} alert{limit} the recordings have the end alone: at what level it stood is not in them."
    elif incident.is_raised_before and highest is incident.changes[0]:
        yield (
            f"The {incident.rule} alert stood at {level}{limit} at its first message in the recordings, {clock.both(highest_s)}. "
            f"It had stood so since {clock.both(facts.raised_s)}{higher}."
        )
    elif incident.is_raised_before:
        yield (
            f"The {incident.rule} alert was raised to {level}{limit} at {clock.both(highest_s)}; the incident began at "
            f"{clock.both(facts.raised_s)} or before."
        )
    else:
        yield f"The {incident.rule} alert was raised to {level}{limit} at {clock.both(highest_s)}."
        if highest_s - facts.raised_s > 0.05:
            first = LEVEL_WORDS.get(incident.changes[0].level, incident.changes[0].level)
            yield f"The incident began {format_fixed(highest_s - facts.raised_s, 1)} s before, with a {first}."
    yield from _why_it_was_raised(clock, highest)
    if again := [clock.time(each.raised_s) for each in facts.rises[1:]]:
        yield f"It was raised to {level} again at {_few(again)} UTC."


def _why_it_was_raised(clock: ReportClock, raised: IncidentChange) -> Iterator[str]:
    """Yield what the value was that raised an alert, where the angle itself was below the limit."""
    if raised.event != "raised" or not raised.is_bound or raised.value_deg is None:
        return
    course = clock.course
    angle_deg = course.motion.angle_at_deg(course.time_s(raised.time_ns))
    then = "" if angle_deg is None else f" of {format_fixed(angle_deg, 1)}°"
    value = f"The {format_fixed(raised.value_deg, 1)}° that raised it were"
    if raised.expected_in_s is None:
        yield f"{value} an upper bound; the angle at that time{then} was estimated below the limit."
    elif raised.expected_in_s > 0:
        expected = f"a peak that was expected {format_fixed(raised.expected_in_s, 1)} s later"
        yield f"{value} the upper bound of {expected}; the angle at that time{then} was below the limit."
    else:
        yield f"{value} the upper bound of the angle at that time, whose best estimate{then} was below the limit."


def _few(texts: Sequence[str]) -> str:
    """Return the first texts, and how many others there are."""
    more = len(texts) - MAX_SUMMARY_RISES
    return " and ".join(
        [", ".join(texts[:MAX_SUMMARY_RISES]), *([f"{more} times more, last {texts[-1]}"] if more > 0 else [])]
    )


def which_settings_were_changed(course: Course, clock: ReportClock, incident: AlertIncident | None) -> Iterator[str]:
    """Yield the changes before the alert reached its highest level, or of the whole time where there is none."""
    alert_s = None if incident is None else course.time_s(incident.highest.time_ns)
    level = "" if incident is None else LEVEL_WORDS.get(incident.level, "alert")
    for change in course.setting_changes:
        if alert_s is None or change.time_s <= alert_s:
            before = "" if alert_s is None else f", {format_fixed(alert_s - change.time_s, 1)} s before the {level}"
            yield f"Before it, {change.words}{_by_whom(clock, change)}; in force from {clock.both(change.time_s)} on{before}."


def _which_others_were(clock: ReportClock, others: Sequence[AlertIncident], hidden: Sequence[str]) -> Iterator[str]:
    """Yield the other incidents of the time, those that stood when the gateway ended or was started, and what hides others."""
    for each in others[:MAX_SUMMARY_OTHERS]:
        if each.is_acknowledgement_alone:
            acknowledged = _acknowledged_texts(clock, each)
            yield f"Of another incident, {each.id} ({each.rule}), only an acknowledgement is in these files ({acknowledged})."
            continue
        level = LEVEL_WORDS.get(each.level, "level not recorded")
        since = f"{clock.time(clock.course.time_s(each.raised_ns))} UTC{' or before' if each.is_raised_before else ''}"
        until = f"{clock.time(clock.course.time_s(each.last_ns))} UTC"
        until = f" to {until}" if each.cleared_ns is not None else f" on; it was last stated at {until}, and has no end"
        yield f"Another incident, no. {each.number} ({each.rule}, {level}): from {since}{until}."
    if len(others) > MAX_SUMMARY_OTHERS:
        yield f"There are {len(others)} others; record incident --list has all of them."
    if hidden:
        yield (
            f"A part of the recordings is missing or cannot be read ({first_of(hidden, 1)}): other incidents may have been, and "
            "the numbers of incidents may be other than in the originals; record incident --list has all that is missing."
        )


def _which_calibrations_changed(course: Course, clock: ReportClock, facts: IncidentFacts) -> Iterator[str]:
    """Yield what was put in force while the alert stood, or in the whole time where there is none."""
    for time_s, calibration in course.calibrations[1:]:
        if facts.begin_s <= time_s <= facts.end_s:
            during = "" if facts.raised_s is None else ", during the incident"
            by = printable_text(str(calibration.record.get("by") or ""), MAX_WORDS_CHARACTERS)
            made = f", made by {by}" if by else ""
            yield f"Another calibration was put in force at {clock.both(time_s)}{during}: {calibration.text}{made}."


def _by_whom(clock: ReportClock, change: SettingChange) -> str:
    if change.audit is None:
        return "; the recordings of this time do not say by whom"
    by = change.audit.content.get("by") or "an unnamed person"
    return f" by {by} at {clock.time(change.audit.time_s)} UTC{change.audit.reason}"


def suspension_texts(course: Course, clock: ReportClock) -> Iterator[str]:
    """Yield when no alert was judged because the sensor was recalibrated, and by whom.

    The first state that the report has may have begun before it, and the last one may end after it.
    """
    spans = course.suspended.spans(course.end_s)
    for number, (begin_s, end_s, by) in enumerate(spans, start=1):
        if by and end_s > course.begin_s:
            before = " or before" if number == 1 or begin_s < course.begin_s else ""
            end = "the end of this report or beyond it" if number == len(spans) else f"{clock.time(end_s)} UTC"
            yield (
                f"From {clock.both(max(begin_s, course.begin_s))}{before} to {end} alerts were suspended, because the sensor was "
                f"recalibrated by {by}: how the load swung then is not known."
            )


def _when_it_was_restarted(course: Course, clock: ReportClock) -> Iterator[str]:
    inside = [each for each in course.restarts if course.begin_s <= each.stopped_s <= course.end_s]
    yield from (restart_text(clock, each) for each in inside[:MAX_SUMMARY_RESTARTS])
    if len(inside) > MAX_SUMMARY_RESTARTS:
        yield f"The gateway was started again {len(inside)} times; the table of events has all of them."


def restart_text(clock: ReportClock, restart: GatewayRestart) -> str:
    """Return when the gateway stopped and was started again, and for how long no alert was judged."""
    if restart.unseen:
        times = f"from {clock.both(restart.stopped_s)} to {clock.both(restart.started_s)}"
        return f"What the gateway did {times} is not known ({restart.unseen}); by then it had been started again."
    stopped = f"was stopped at {clock.both(restart.stopped_s)}"
    if not restart.is_announced:
        lost = format_short(clock.course.fsync_s(restart.stopped_s), 3)
        longer = f"it may have run up to {lost} s longer, or more where somebody has cut its file"
        stopped = f"stopped without notice (recorded up to {clock.both(restart.stopped_s)}; {longer})"
    if restart.started_s > clock.course.end_s:
        return f"The gateway {stopped} and was started again at {clock.both(restart.started_s)}, after the time of this report."
    times = f"{stopped} and was started again at {clock.time(restart.started_s)} UTC"
    if restart.hole is not None:
        hole = f"from {clock.time(restart.hole.begin_s)} to {clock.time(restart.hole.end_s)} UTC"
        return (
            f"The gateway {times}; {hole} the recordings have a gap ({restart.hole.cause}), so that whether alerts were judged "
            "then is not known."
        )
    suspended = (begin_s for begin_s, _, by in clock.course.suspended.spans(clock.course.end_s) if by)
    suspended_s = next((each for each in suspended if each >= restart.started_s), inf)
    until_s = inf if restart.judged_s is None else restart.judged_s
    if suspended_s < until_s:
        length = format_fixed(suspended_s - restart.stopped_s, 1)
        return f"The gateway {times}: alerts were not judged for {length} s, until they were suspended."
    if restart.judged_s is None:
        return f"The gateway {times}: as far as this report goes, no alert was judged from then on."
    return f"The gateway {times}: alerts were not judged for {format_fixed(until_s - restart.stopped_s, 1)} s."


def _when_it_ended(
    course: Course, clock: ReportClock, incident: AlertIncident | None, facts: IncidentFacts
) -> Iterator[str]:
    if incident is None or facts.raised_s is None:
        return
    if facts.cleared_s is None:
        until, after = clock.both(min(course.time_s(incident.last_ns), course.end_s)), _after(course, facts.end_s)
        stood = f"it stood at {until}"
        if incident.unknown_ns is not None:
            stood = f"its level was not known from {clock.both(course.time_s(incident.unknown_ns))} to {until}"
        if after:
            yield f"The recordings state no end of it: {stood}, after which {after}."
        else:
            yield as_sentence(f"{stood}, where this report ends; the recordings go on")
        if course.end_cause:
            yield f"The last recording ends at {clock.both(course.end_s)}. {course.end_cause}."
    else:
        after_s = format_fixed(facts.cleared_s - facts.raised_s, 1)
        least = "at least " if incident.is_raised_before else ""
        after = f", {least}{after_s} s after it began" if facts.cleared_s > facts.raised_s else ""
        yield f"It cleared at {clock.both(facts.cleared_s)}{after}."
        if facts.blind_s is not None:
            from_s, to_s = facts.blind_s
            unknown = "No angle was known" if course.is_whole(from_s, to_s) else "The recordings have no angle"
            level = "the limit" if facts.clear_deg is None else f"{format_limit(facts.clear_deg)}°"
            yield f"{unknown} from {clock.time(from_s)} to {clock.time(to_s)} UTC: when it fell below {level} is not known."
        if incident.is_raised_before:
            own = next(change.text for change in reversed(incident.changes) if change.event == "cleared")
            yield f"The gateway's own words: {printable_text(own, MAX_WORDS_CHARACTERS)}."
    yield from _who_acknowledged(clock, incident, facts)
    for mark in course.marks[:MAX_SUMMARY_MARKS]:
        before = facts.begin_s - mark.time_s
        early = f", {format_fixed(before, 1)} s before the incident" if before > 0 else ""
        yield f"Mark at {clock.both(mark.time_s)}{early}, by {mark.text}."


def _after(course: Course, end_s: float) -> str:
    """Return what is behind the last message of an alert that has no end; empty: the report ends, and the recordings go on."""
    gap = next((each for each in course.holes if abs(each.begin_s - end_s) < MAX_ALERT_SILENCE_S), None)
    if gap is not None:
        return f"the recordings have a gap of {format_fixed(gap.end_s - gap.begin_s, 1)} s ({gap.cause})"
    restart = next((each for each in course.restarts if 0 <= each.stopped_s - end_s < MAX_ALERT_SILENCE_S), None)
    if restart is not None:
        return "the gateway was stopped" if restart.is_announced else "the gateway stopped without notice"
    if course.end_s - end_s > MAX_ALERT_SILENCE_S:
        return "the gateway was stopped or restarted"
    return "they end" if course.end_cause else ""


def where_it_stood(course: Course, incident: AlertIncident) -> str:
    """Return at what an alert without an end stood last; empty where it goes on behind the course."""
    is_unknown = incident.unknown_ns is not None
    if incident.is_acknowledgement_alone:
        return ""
    if course.end_s - course.time_s(incident.last_ns) > MAX_ALERT_SILENCE_S:
        stood = "had no known level" if is_unknown else "stood"
        return f"{stood} when it was last stated, after which {_after(course, course.time_s(incident.last_ns))}"
    stands = "has no end, and no known level," if is_unknown else "stands"
    return f"{stands} where the recordings end" if course.end_cause else ""


def _who_acknowledged(clock: ReportClock, incident: AlertIncident, facts: IncidentFacts) -> Iterator[str]:
    """Yield who acknowledged what, and up to when the recordings were searched for more."""
    course, known = clock.course, incident.acknowledgements
    left = ", as far as they are left," if "recordings" in facts.angle.missing else ""
    searched = f"up to {clock.both(course.checked_s)}, as far as they were read and checked"
    if not known:
        yield f"The recordings{left} state no acknowledgement of it {searched}."
        return
    last = f"after it was last stated at {clock.both(course.time_s(incident.last_ns))}"
    ended = last if incident.cleared_ns is None else "after its end"
    for each in known[-MAX_SUMMARY_MARKS:]:
        reason = f", with the words: {each.reason}" if each.reason else ""
        stood = STOOD_WORDS.get(each.level, ended)
        yield f"It was acknowledged at {clock.both(course.time_s(each.time_ns))} by {each.acknowledged_by}, {stood}{reason}."
    level = LEVEL_WORDS.get(incident.level, incident.level)
    later = [clock.time(each.raised_s) for each in facts.rises if each.raised_s > course.time_s(known[-1].time_ns)]
    if later:
        yield f"The recordings{left} state no acknowledgement of the {level} of {_few(later)} UTC that followed, {searched}."


def _how_good(course: Course, facts: IncidentFacts) -> Iterator[str]:
    samples = course.samples
    rate = "" if samples.rate_hz is None else f" at {format_short(samples.rate_hz, 4)} Hz"
    if samples.gaps:
        longest = max(samples.gaps, key=lambda gap: gap.end_s - gap.begin_s)
        longest_s = longest.end_s - longest.begin_s
        least = "at least " if longest.begin_s <= course.begin_s or longest.end_s >= course.end_s else ""
        causes = ", ".join(dict.fromkeys(gap.cause for gap in samples.gaps))
        gaps = f"{counted(len(samples.gaps), 'gap')}, the longest {least}{format_fixed(longest_s, 2)} s ({causes})"
    else:
        gaps = "no gap"
    yield f"The report covers {samples.count} samples{rate}, with {gaps}, {samples.lost} lost and {samples.invalid} invalid."
    if facts.known_share is not None and facts.trusted_share is not None:
        known, trusted = format_percent(100 * facts.known_share), format_percent(100 * facts.trusted_share)
        time = "the time that has samples" if samples.gaps else "the time"
        yield f"The angle was known for {known} of {time}, and the reading was trusted for {trusted}."
    qualities = list(dict.fromkeys(course.clock.state))
    yield from (CLOCKS[quality] for quality in qualities if quality in CLOCKS)
    if course.clock_steps_s:
        yield f"The wall clock stepped {len(course.clock_steps_s)} times; the times of this report do not step with it."
