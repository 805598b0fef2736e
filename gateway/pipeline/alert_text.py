"""The alerts in the words of an operator: a line for each rule that is not normal, and a line for each change."""

import math

from gateway.messages import AlertEventKind, Level
from gateway.pipeline.incidents import Acknowledgement, Incident
from gateway.stages.alerts import Reading
from gateway.units import degrees

MIN_LEAD_S = 0.05
"""A peak that comes sooner is the present angle. Definition: the resolution of the text."""


def reading_text(reading: Reading | None, limit_rad: float) -> str:
    """Return `up to 6.4 deg now`; a bound at or above the limit is said to be one, with the best estimate of the angle."""
    value_deg = None if reading is None else degrees(reading.value_rad)
    if reading is None or value_deg is None:
        return "not known now"
    when = "now" if reading.expected_in_s < MIN_LEAD_S else f"expected in {reading.expected_in_s:.1f} s"
    text = f"up to {value_deg:.1f} deg {when}"
    if reading.value_rad >= limit_rad and reading.is_bound(limit_rad):
        text += f", an upper bound, angle now {math.degrees(reading.now.best_rad):.1f} deg"
    return text


def limits_text(limit_rad: float, clear_rad: float) -> str:
    """Return the limit of a level and the clear level."""
    return f"limit {math.degrees(limit_rad):.1f} deg, clears below {math.degrees(clear_rad):.1f} deg"


def refuted_text(incident: Incident) -> str:
    """Return that the first value of an incident was a bound, and what the angle was."""
    return f"limit {math.degrees(incident.limit_rad):.1f} deg was not reached: {largest_text(incident)}"


def largest_text(incident: Incident) -> str:
    """Return the largest angle of an incident with the upper end of its interval."""
    if incident.known_s == -math.inf:
        return "angle not known"
    known = "angle" if incident.is_seen_throughout else "known angle"
    largest_deg, upper_deg = math.degrees(incident.largest_rad), math.degrees(incident.largest_upper_rad)
    return f"largest {known} {largest_deg:.1f} deg, at most {upper_deg:.1f} deg"


def change_text(
    rule: str, event: AlertEventKind, level: Level, description: str, incident: Incident | None, time_s: float
) -> str:
    """Return the line of one change; `description` is what the present reading or its reason says, with the limits."""
    match event:
        case "raised":
            text = f"{rule} raised to {level}: {description}"
        case "cleared" if incident is not None:
            text = f"{rule} cleared after {time_s - incident.begin_s:.1f} s: {_course_text(incident)}"
        case "corrected" if incident is not None:
            text = f"{rule} {level} corrected: {refuted_text(incident)}; the first value was an upper bound"
        case _:
            text = f"{rule} changed to {level}" + (f": {description}" if description else "")
    return text if incident is None else f"{text} [incident {incident.id}]"


def acknowledged_text(acknowledgement: Acknowledgement, incident: Incident) -> str:
    """Return the line of an acknowledgement."""
    reason = f": {acknowledgement.reason}" if acknowledgement.reason else ""
    return f"{incident.rule} acknowledged by {acknowledgement.by}{reason} [incident {incident.id}]"


def _course_text(incident: Incident) -> str:
    if incident.first is None:
        return "the cause has ended"
    if incident.is_refuted:
        return refuted_text(incident)
    return f"{largest_text(incident)} (limit {math.degrees(incident.limit_rad):.1f} deg)"
