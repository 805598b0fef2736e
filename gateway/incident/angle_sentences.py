"""How large the angle was in an incident, and whether it reached the limit, in words."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gateway.documents.format import format_fixed, format_limit
from gateway.incident.facts import AlertRise, IncidentFacts, KnownAngle, PeakAngle
from gateway.incident.incident_selection import AlertIncident
from gateway.incident.timeline_figure import ReportClock
from gateway.stages.alerts import GRACE_S

MAX_SUMMARY_RISES = 5
"""Raises to the highest level in the summary. Basis: a choice; it stays on one page, the events have all of them."""
SAME_TIME_S = 0.05
"""Up to this difference two times are the same. Definition: seconds are printed to a tenth."""
LEVEL_WORDS = {"warn": "warning", "trip": "trip"}


def angle_sentences(clock: ReportClock, incident: AlertIncident | None, facts: IncidentFacts) -> Iterator[str]:
    """Yield how large the angle was, what is not known of it, and whether it reached the limit."""
    if facts.peak is None:
        yield "The angle was not known at any time of it."
    else:
        reasons = _not_known(clock, facts, facts.angle)
        known = "known " if facts.angle.missing or facts.angle.unknown_s > GRACE_S else ""
        yield (
            f"The largest {known}angle between rope and vertical was {_angle_text(facts.peak)} at "
            f"{clock.both(facts.peak.time_s)}{': ' if reasons else ''}{'; '.join(reasons)}."
        )
    if facts.limit_deg is None or incident is None:
        return
    if facts.stated_deg is not None and {"recordings", "report"} & set(facts.angle.missing):
        largest, upper = (format_fixed(each, 2) for each in facts.stated_deg)
        yield f"By the alert itself it was {largest}°, at most {upper}°, over the whole incident."
    level = LEVEL_WORDS.get(incident.level, incident.level)
    if len(facts.rises) == 1:
        yield _limit_text(clock, facts, replace(facts.rises[0], answer=facts.answer), "It", level)
        return
    for rise in facts.rises[:MAX_SUMMARY_RISES]:
        yield _limit_text(clock, facts, rise, f"After the {level} of {clock.time(rise.raised_s)} UTC it", level)
    if more := facts.rises[MAX_SUMMARY_RISES:]:
        reached = sum(each.answer == "reached" for each in more)
        yield f"After {reached} of the {len(more)} later ones it reached that limit."


def _not_known(clock: ReportClock, facts: IncidentFacts, angle: KnownAngle) -> list[str]:
    """Return what is not known of the angle, and why."""
    whole = "this time" if facts.raised_s is None else "the incident"
    texts = {
        "recordings": f"a part of {whole} is not in the recordings",
        "report": f"a part of {whole} is outside the time of this report",
        "end": f"what came {_after_the_end(clock, facts.end_s)} is not known",
    }
    if angle.peak is None:
        return [*(texts[each] for each in angle.missing), "it was not known at any time"]
    unknown = f"for {format_fixed(angle.unknown_s, 1)} s of {whole} it was not known"
    return [*(texts[each] for each in angle.missing), *([unknown] if angle.unknown_s > GRACE_S else [])]


def _after_the_end(clock: ReportClock, end_s: float) -> str:
    """Return the time behind the end of an incident that has none, until the angle is known again."""
    motion = clock.course.motion
    again = motion.time_s[(motion.time_s > end_s) & np.isfinite(motion.angle_deg)]
    return (
        f"between {clock.time(end_s)} and {clock.time(float(again[0]))}" if len(again) else f"after {clock.time(end_s)}"
    )


def _limit_text(clock: ReportClock, facts: IncidentFacts, rise: AlertRise, subject: str, level: str) -> str:
    """Return whether and when the angle was above the limit from a raise to a level on, `It` over the whole incident."""
    limit_deg = facts.limit_deg or 0.0
    limit, when = f"the limit of {format_limit(limit_deg)}°", _lead_text(rise, level)
    if rise.answer == "not_reached":
        return f"{subject} did not reach {limit}: the alert came from an upper bound that was not reached."
    if rise.answer == "reached":
        return f"{subject} reached {limit}{when or '; when first is not in this report'}."
    low_deg, high_deg = (0.0, 0.0) if rise.angle.peak is None else rise.angle.peak.interval_deg
    stated_deg = 0.0 if facts.stated_deg is None else facts.stated_deg[1]
    reasons = _not_known(clock, facts, rise.angle)
    if when:
        why = f"the best estimate did, and the interval of 95 % reaches down to {format_fixed(low_deg, 2)}°"
    elif high_deg >= limit_deg:
        why = f"the interval of 95 % reaches up to {format_fixed(high_deg, 2)}°"
    elif stated_deg >= limit_deg and subject == "It":
        why = f"by the alert itself it was at most {format_fixed(stated_deg, 2)}°"
    else:
        known = "The known angle" if subject == "It" else f"{subject.removesuffix('it')}the known angle"
        return f"{known} did not reach {limit}; whether the load did is not known: {'; '.join(reasons)}."
    return f"{subject} may have reached {limit}{when}: {'; '.join([why, *reasons])}."


def _lead_text(rise: AlertRise, level: str) -> str:
    """Return when the angle reached the limit, counted from the raise; empty: that is not known."""
    if rise.reached_s is None:
        return ""
    lead_s = rise.reached_s - rise.raised_s
    if abs(lead_s) <= SAME_TIME_S:
        return f" when the {level} was raised"
    return f" {format_fixed(abs(lead_s), 1)} s {'after' if lead_s > 0 else 'before'} the {level}"


def _angle_text(peak: PeakAngle) -> str:
    """Return the angle with its interval, and its direction."""
    low_deg, high_deg = peak.interval_deg
    decimals = 2 if high_deg - low_deg < 1 else 1
    angle, low, high = (format_fixed(each, decimals) for each in (peak.angle_deg, low_deg, high_deg))
    side = "" if peak.azimuth_deg is None else f", towards azimuth {format_fixed(peak.azimuth_deg, 0)}° of the housing,"
    return f"{angle}° ({low}° to {high}° at 95 %){side}"
