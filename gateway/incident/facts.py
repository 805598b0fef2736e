"""The numbers of an incident, from its course, and as JSON."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gateway.incident.course import TRUSTED_TEXT, Course, MotionCourse
from gateway.incident.evidence import IncidentEvidence, RecordVerdict
from gateway.incident.incident_selection import AlertIncident
from gateway.incident.sample_gaps import TimeGap
from gateway.messages import SCHEMA_VERSION
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.recording.reading.interval import iso_utc

CAUSE_BEFORE_S = 20.0
"""What moved within this time before the peak is stated as what went before it. Basis: three periods of a rope of 10 m."""
MOVES = ("driven", "hoisting", "wind")
UNKNOWN = "unknown"
MIN_MOVE_S = 0.5
"""A shorter state is left out of the sentences. Basis: five updates."""


@dataclass(frozen=True, slots=True)
class PeakAngle:
    """The largest angle between rope and vertical, with its standard uncertainty."""

    time_s: float
    angle_deg: float
    u_deg: float
    azimuth_deg: float | None

    @property
    def interval_deg(self) -> tuple[float, float]:
        """Coverage interval of 95 %."""
        half_deg = NORMAL_975 * self.u_deg
        return max(0.0, self.angle_deg - half_deg), self.angle_deg + half_deg


@dataclass(frozen=True, slots=True)
class CraneMove:
    """A time in which the pivot or the winch moved, or a gust pushed."""

    state: str
    begin_s: float
    end_s: float
    pivot_m_s2: float | None
    """Largest horizontal acceleration of the pivot."""
    hoist_m_s: float | None
    """Largest rate of the rope's length, lowering positive."""


@dataclass(frozen=True, slots=True)
class ForceExtremes:
    """The smallest and largest specific force of each axis, shape (3,)."""

    low_g: Array
    high_g: Array


@dataclass(frozen=True, slots=True)
class IncidentFacts:
    """The numbers of the summary; seconds are those of the course."""

    begin_s: float
    """Begin of the incident, or of the course where there is none."""
    end_s: float
    """Last time at which the alert is known to have stood, or the end of the course."""
    raised_s: float | None
    """Of an incident whose raise is not in the recordings: the earliest time at which it is known to have stood."""
    level_raised_s: float | None
    """The same of its highest level."""
    cleared_s: float | None
    peak: PeakAngle | None
    is_whole: bool
    """The recordings have all of the incident up to its end, or to the last word of it."""
    is_open: bool
    """The alert has no end in them, so that the angle may have become larger than the peak."""
    unknown_s: float
    """How much of the incident has a motion whose angle was not known."""
    reached_s: float | None
    """First time at which the best estimate of the angle reached the limit; None: it did not, or before what is recorded."""
    moves: tuple[CraneMove, ...]
    """In the CAUSE_BEFORE_S before the peak."""
    unseen_s: float
    """How much of the CAUSE_BEFORE_S is not in the report, or has a motion that was not known."""
    unseen_causes: tuple[str, ...]
    lean_deg: float | None
    """At the peak."""
    length_m: float | None
    force: ForceExtremes | None
    trusted_share: float | None
    known_share: float | None
    """Share of the messages of the motion that know the angle."""


def incident_facts(course: Course, incident: AlertIncident | None) -> IncidentFacts:
    """Return the numbers of an incident, or of the whole course where there is none."""
    raised_s = None if incident is None else course.time_s(incident.raised_ns)
    cleared_ns = None if incident is None else incident.cleared_ns
    cleared_s = None if cleared_ns is None else course.time_s(cleared_ns)
    begin_s = course.begin_s if raised_s is None else max(raised_s, course.begin_s)
    end_s = course.end_s if incident is None else min(course.time_s(incident.last_ns), course.end_s)
    limit_deg = None if incident is None else incident.highest.limit_deg
    peak = _peak(course, begin_s, end_s)
    begins_inside = incident is None or not incident.is_raised_before
    reached_s = None if limit_deg is None else _first_at(course.motion, limit_deg, begin_s, end_s)
    if reached_s is not None and not (begins_inside and course.is_whole(begin_s, reached_s)):
        reached_s = None
    unseen_s, unseen_causes = (0.0, ()) if peak is None else _unseen(course, peak.time_s)
    motion = course.motion
    at_peak = None if peak is None else int(np.argmin(np.abs(motion.time_s - peak.time_s)))
    return IncidentFacts(
        begin_s=begin_s,
        end_s=end_s,
        raised_s=raised_s,
        level_raised_s=_level_raised_s(course, incident),
        cleared_s=cleared_s,
        peak=peak,
        is_whole=begins_inside and course.is_whole(begin_s, end_s),
        is_open=incident is not None and cleared_s is None,
        unknown_s=_unknown_s(motion, begin_s, end_s),
        reached_s=reached_s,
        moves=() if peak is None else _moves(course, peak.time_s),
        unseen_s=unseen_s,
        unseen_causes=unseen_causes,
        lean_deg=None if at_peak is None else _finite(motion.lean_deg[at_peak]),
        length_m=None if at_peak is None else _finite(motion.length_m[at_peak]),
        force=_extremes(course, begin_s, end_s),
        trusted_share=course.trusted.share_of(TRUSTED_TEXT, course.end_s),
        known_share=float(np.isfinite(motion.angle_deg).mean()) if len(motion.time_s) else None,
    )


def _unknown_s(motion: MotionCourse, begin_s: float, end_s: float) -> float:
    """Return for how long the angle was not known between two times, by the messages of the motion in them."""
    inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s)
    if np.count_nonzero(inside) < 2:
        return 0.0
    unknown = int(np.count_nonzero(np.isnan(motion.angle_deg[inside])))
    return unknown * float(np.median(np.diff(motion.time_s[inside])))


def _peak(course: Course, begin_s: float, end_s: float) -> PeakAngle | None:
    motion = course.motion
    inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s) & np.isfinite(motion.angle_deg + motion.u_deg)
    if not inside.any():
        return None
    index = int(np.argmax(np.where(inside, motion.angle_deg, -np.inf)))
    return PeakAngle(
        time_s=float(motion.time_s[index]),
        angle_deg=float(motion.angle_deg[index]),
        u_deg=float(motion.u_deg[index]),
        azimuth_deg=_finite(motion.azimuth_deg[index]),
    )


def _level_raised_s(course: Course, incident: AlertIncident | None) -> float | None:
    if incident is None:
        return None
    is_first = incident.highest is incident.changes[0]
    return course.time_s(incident.raised_ns if is_first else incident.highest.time_ns)


def _first_at(motion: MotionCourse, limit_deg: float, begin_s: float, end_s: float) -> float | None:
    inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s)
    reached = np.flatnonzero(inside & (motion.angle_deg >= limit_deg))
    return float(motion.time_s[reached[0]]) if len(reached) else None


def _unseen(course: Course, peak_s: float) -> tuple[float, tuple[str, ...]]:
    """Return how much of the time before the peak says nothing about its cause, and why."""
    begin_s = peak_s - CAUSE_BEFORE_S
    unknown = [each for each in course.motion.states.spans(course.end_s) if each[2] == UNKNOWN]
    absent = [
        TimeGap(begin_s, course.begin_s, course.begin_cause),
        *course.samples.gaps,
        *(TimeGap(from_s, to_s, "the motion was not known") for from_s, to_s, _ in unknown),
    ]
    found = sorted((each for each in absent if each.within_s(begin_s, peak_s) > 0), key=lambda gap: gap.begin_s)
    unseen_s, seen_until_s = 0.0, begin_s
    for each in found:  # they may overlap
        unseen_s += each.within_s(seen_until_s, peak_s)
        seen_until_s = max(seen_until_s, each.end_s)
    return unseen_s, tuple(dict.fromkeys(each.cause for each in found))


def _moves(course: Course, peak_s: float) -> tuple[CraneMove, ...]:
    """Return what moved before the peak, in order of time."""
    motion = course.motion
    spans: list[tuple[float, float, str]] = []
    for from_s, to_s, state in motion.states.spans(course.end_s):
        if spans and spans[-1][2] == state and from_s - spans[-1][1] < MIN_MOVE_S:
            spans[-1] = (spans[-1][0], to_s, state)
        elif state in MOVES:
            spans.append((from_s, to_s, state))
    found = []
    for from_s, to_s, state in spans:
        begin_s, end_s = max(from_s, peak_s - CAUSE_BEFORE_S), min(to_s, peak_s)
        if end_s - begin_s >= MIN_MOVE_S:
            inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s)
            pivot_m_s2 = np.hypot(*motion.pivot_m_s2[inside].T)
            hoist_m_s = motion.hoist_m_s[inside]
            found.append(CraneMove(state, begin_s, end_s, _largest(pivot_m_s2), _largest(hoist_m_s)))
    return tuple(found)


def _largest(values: Array) -> float | None:
    """Return the value of the largest magnitude; None where none is known."""
    known = values[np.isfinite(values)]
    return float(known[np.argmax(np.abs(known))]) if len(known) else None


def _extremes(course: Course, begin_s: float, end_s: float) -> ForceExtremes | None:
    time_s, force_g = course.acceleration.time_s, course.acceleration.force_g
    inside = (time_s >= begin_s) & (time_s <= end_s)
    if not inside.any() or not np.isfinite(force_g[inside]).all():
        return None
    return ForceExtremes(force_g[inside].min(axis=0), force_g[inside].max(axis=0))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def facts_json(evidence: IncidentEvidence, facts: IncidentFacts, verification: RecordVerdict) -> dict[str, Any]:
    """Return what the page states, for programs; null: not known."""
    course, incident = evidence.course, evidence.window.incident
    utc = {
        name: None if time_s is None else iso_utc(course.utc_ns(time_s))
        for name, time_s in (
            ("raised", facts.raised_s),
            ("level_raised", facts.level_raised_s),
            ("cleared", facts.cleared_s),
            ("limit_reached", facts.reached_s),
            ("from", course.begin_s),
            ("to", course.end_s),
        )
    }
    return {
        "schema_version": SCHEMA_VERSION,
        "gateway": evidence.gateway,
        "source": course.source.lower() or "sensor",
        "device": {"kind": evidence.device.get("kind"), "device_id": evidence.device.get("device_id")},
        "incident": None if incident is None else incident.id,
        "number": None if incident is None else incident.number,
        "rule": None if incident is None else incident.rule,
        "level": None if incident is None else incident.level,
        "limit_deg": None if incident is None else incident.highest.limit_deg,
        "clear_deg": None if incident is None else incident.highest.clear_deg,
        "raised_by_bound": None if incident is None else incident.highest.is_bound,
        "utc": utc,
        "is_raised_before": None if incident is None else incident.is_raised_before,
        "is_whole": facts.is_whole and not facts.is_open,
        "largest_deg": None if incident is None else incident.largest_deg,
        "largest_upper_deg": None if incident is None else incident.largest_upper_deg,
        "acknowledged": _acknowledgement(evidence),
        "peak": None if facts.peak is None else _peak_json(evidence, facts.peak),
        "moves": [
            {
                "state": move.state,
                "from": iso_utc(course.utc_ns(move.begin_s)),
                "to": iso_utc(course.utc_ns(move.end_s)),
                "pivot_accel_m_s2": move.pivot_m_s2,
                "hoist_m_s": move.hoist_m_s,
            }
            for move in facts.moves
        ],
        "unseen_before_peak_s": facts.unseen_s,
        "lean_deg": facts.lean_deg,
        "length_m": facts.length_m,
        "specific_force_g": None
        if facts.force is None
        else {"min": facts.force.low_g.tolist(), "max": facts.force.high_g.tolist()},
        "known_share": facts.known_share,
        "trusted_share": facts.trusted_share,
        "samples": {
            "count": course.samples.count,
            "rate_hz": course.samples.rate_hz,
            "lost": course.samples.lost,
            "invalid": course.samples.invalid,
            "gaps": len(course.samples.gaps),
            "missing": [
                {
                    "from": iso_utc(course.utc_ns(gap.begin_s)),
                    "to": iso_utc(course.utc_ns(gap.end_s)),
                    "cause": gap.cause,
                }
                for gap in course.samples.gaps
            ],
        },
        "calibration_ids": [calibration.calibration_id for _, calibration in course.calibrations],
        "verification": {
            "verdict": verification.kind,
            "text": verification.label,
            "scope": verification.scope,
            "remarks": list(verification.sentences),
        },
        "sources": [{"file": source.path.name, "sha256": source.sha256} for source in evidence.sources],
    }


def _acknowledgement(evidence: IncidentEvidence) -> dict[str, Any] | None:
    incident = evidence.window.incident
    known = None if incident is None else incident.acknowledgement
    if known is None:
        return None
    time_s = evidence.course.time_s(known.time_ns)
    return {"by": known.acknowledged_by, "reason": known.reason, "utc": iso_utc(evidence.course.utc_ns(time_s))}


def _peak_json(evidence: IncidentEvidence, peak: PeakAngle) -> dict[str, Any]:
    return {
        "utc": iso_utc(evidence.course.utc_ns(peak.time_s)),
        "angle_deg": peak.angle_deg,
        "u_deg": peak.u_deg,
        "coverage95_deg": list(peak.interval_deg),
        "azimuth_deg": peak.azimuth_deg,
    }
