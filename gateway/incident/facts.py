"""The numbers of an incident, from its course, and as JSON."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gateway.incident.cause import LoadCauses, SmoothMotion, load_causes
from gateway.incident.course import TRUSTED_TEXT, Course
from gateway.incident.evidence import IncidentEvidence
from gateway.incident.incident_selection import AlertIncident
from gateway.incident.record_verdict import RecordVerdict
from gateway.messages import SCHEMA_VERSION
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.alert_rules import SWING
from gateway.recording.reading.interval import iso_utc
from gateway.stages.alerts import GRACE_S

LimitAnswer = Literal["not_reached", "may_have_been", "reached"]
"""Definition: whether the angle was above a limit, in ascending order."""
ANSWERS: tuple[LimitAnswer, ...] = ("not_reached", "may_have_been", "reached")
Missing = Literal["recordings", "report", "end"]
"""Definition: what is not there of an incident: some of it in the recordings, in the time of the report, or its end."""


@dataclass(frozen=True, slots=True)
class PeakAngle:
    """The largest known angle between rope and vertical, with its standard uncertainty."""

    time_s: float
    angle_deg: float
    u_deg: float
    interval_deg: tuple[float, float]
    """Coverage interval of 95 % of the largest angle: the largest lower and the largest upper end of all times."""
    azimuth_deg: float | None


@dataclass(frozen=True, slots=True)
class KnownAngle:
    """What is known of the angle between two times."""

    peak: PeakAngle | None
    """None: the angle was not known at any time."""
    unknown_s: float
    """For how long the angle was not known, because its messages do not know it, or no samples arrived."""
    missing: tuple[Missing, ...]
    """What else is not known of this time; empty: all messages of it are there."""

    @property
    def is_known(self) -> bool:
        """The angle was known throughout, but for the time that an alert takes for none."""
        return self.peak is not None and not self.missing and self.unknown_s <= GRACE_S

    def answer(self, limit_deg: float) -> LimitAnswer:
        """Return whether the angle was above a limit."""
        low_deg, high_deg = (0.0, 0.0) if self.peak is None else self.peak.interval_deg
        if low_deg >= limit_deg:
            return "reached"
        return "not_reached" if self.is_known and high_deg < limit_deg else "may_have_been"


@dataclass(frozen=True, slots=True)
class AlertRise:
    """A raise of the alert to its highest level, and the angle from it until the next one, or the end of the incident.

    The angle of the first one is that from the begin of the incident on.
    """

    raised_s: float
    angle: KnownAngle
    answer: LimitAnswer | None
    """Whether the angle was above the limit; None: the alert is not of the swing, or has no limit."""
    reached_s: float | None
    """First time at which the best estimate was at the limit; None: it was not, or before what is recorded."""


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
    """Its end, or the last time that is recorded of it, or the end of the course."""
    raised_s: float | None
    """Of an incident whose raise is not in the recordings: the earliest time at which it is known to have stood."""
    cleared_s: float | None
    blind_s: tuple[float, float] | None
    """Time without an angle that ends when the swing alert cleared, or so shortly before that the angle had not been below the
    level at which it clears for the hold time; None: there is none."""
    clear_deg: float | None
    """The level at which the alert clears; None: it is not recorded."""
    angle: KnownAngle
    """Of the whole incident."""
    limit_deg: float | None
    """The limit of the highest level of the swing alert; None: the alert is another one, or has none."""
    rises: tuple[AlertRise, ...]
    stated_deg: tuple[float, float] | None
    """Largest angle and largest upper end of its interval by the alert itself, also of what is not in the recordings."""
    causes: LoadCauses
    lean_deg: float | None
    """At the peak."""
    length_m: float | None
    force: ForceExtremes | None
    trusted_share: float | None
    known_share: float | None
    """Share of the messages of the motion that know the angle."""

    @property
    def peak(self) -> PeakAngle | None:
        """The largest angle; None: it was not known at any time."""
        return self.angle.peak

    @property
    def answer(self) -> LimitAnswer | None:
        """Whether the angle was above the limit at any time of the incident; None: there is no limit."""
        if self.limit_deg is None:
            return None
        answers = [each.answer for each in self.rises if each.answer is not None]
        if self.stated_deg is not None:
            largest_deg, upper_deg = self.stated_deg
            answers += ["may_have_been"] if upper_deg >= self.limit_deg else []
            answers += ["reached"] if 2 * largest_deg - upper_deg >= self.limit_deg else []
        return max(answers, key=ANSWERS.index, default=None)

    @property
    def reached_s(self) -> float | None:
        """First time at which the best estimate was at the limit."""
        return next((each.reached_s for each in self.rises if each.reached_s is not None), None)


def incident_facts(
    course: Course, incident: AlertIncident | None, cut: Path | None = None, smooth: SmoothMotion | None = None
) -> IncidentFacts:
    """Return the numbers of an incident, or of the whole course where there is none.

    `cut`: the recording of the course, of which `smooth` smooths the motion; None: it is not smoothed.
    """
    if incident is not None and incident.is_acknowledgement_alone:
        return _nothing_known(course)
    raised_s = None if incident is None else course.time_s(incident.raised_ns)
    cleared_ns = None if incident is None else incident.cleared_ns
    begin_s, end_s = course.begin_s, course.end_s
    if incident is not None and raised_s is not None:
        last_s = course.time_s(incident.last_ns)
        begin_s = max(raised_s, begin_s)
        end_s = min(last_s if cleared_ns is not None else course.recorded_until_s(last_s), end_s)
    angle = _known_angle(course, incident, begin_s, end_s)
    peak, motion = angle.peak, course.motion
    limit_deg = incident.highest.limit_deg if incident is not None and incident.rule == SWING.name else None
    stated_deg = None
    if incident is not None and incident.largest_deg is not None and incident.largest_upper_deg is not None:
        stated_deg = incident.largest_deg, incident.largest_upper_deg
    at_peak = None if peak is None else int(np.argmin(np.abs(motion.time_s - peak.time_s)))
    return IncidentFacts(
        begin_s=begin_s,
        end_s=end_s,
        raised_s=raised_s,
        cleared_s=None if cleared_ns is None else course.time_s(cleared_ns),
        blind_s=None if incident is None or incident.rule != SWING.name else _blind_before_end(course, begin_s, end_s),
        clear_deg=None if incident is None else incident.highest.clear_deg,
        angle=angle,
        limit_deg=limit_deg,
        rises=() if incident is None else _rises(course, incident, limit_deg, begin_s, end_s),
        stated_deg=stated_deg,
        causes=LoadCauses() if peak is None else load_causes(course, peak.time_s, cut, smooth),
        lean_deg=None if at_peak is None else _finite(motion.lean_deg[at_peak]),
        length_m=None if at_peak is None else _finite(motion.length_m[at_peak]),
        force=_extremes(course, begin_s, end_s),
        trusted_share=course.trusted.share_of(TRUSTED_TEXT, course.end_s),
        known_share=float(np.isfinite(motion.angle_deg).mean()) if len(motion.time_s) else None,
    )


def _nothing_known(course: Course) -> IncidentFacts:
    """Return the facts of an incident of which nothing is recorded."""
    return IncidentFacts(
        begin_s=course.begin_s,
        end_s=course.end_s,
        raised_s=None,
        cleared_s=None,
        blind_s=None,
        clear_deg=None,
        angle=KnownAngle(None, course.end_s - course.begin_s, ("recordings",)),
        limit_deg=None,
        rises=(),
        stated_deg=None,
        causes=LoadCauses(),
        lean_deg=None,
        length_m=None,
        force=None,
        trusted_share=None,
        known_share=None,
    )


def _known_angle(
    course: Course,
    incident: AlertIncident | None,
    begin_s: float,
    end_s: float,
    *,
    has_begin: bool = True,
    has_end: bool = True,
) -> KnownAngle:
    """Return what is known of the angle between two times, which are begin and end of the incident or lie in it."""
    motion = course.motion
    inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s)
    missing: list[Missing] = [] if course.is_whole(begin_s, end_s) else ["recordings"]
    if incident is not None and has_begin:
        is_earlier = course.begin_s - course.time_s(incident.raised_ns) > GRACE_S
        missing += ["recordings"] if incident.is_raised_before else ["report"] if is_earlier else []
    if incident is not None and has_end:
        is_later = course.time_s(incident.last_ns) - course.end_s > GRACE_S
        missing += ["report"] if is_later else ["end"] if incident.cleared_ns is None else []
    unknown_s = sum(gap.within_s(begin_s, end_s) for gap in course.samples.gaps if not gap.is_hole)
    if np.count_nonzero(inside) > 1:
        unknown = int(np.count_nonzero(np.isnan(motion.angle_deg[inside])))
        unknown_s += unknown * float(np.median(np.diff(motion.time_s[inside])))
    return KnownAngle(_peak(course, inside), unknown_s, tuple(dict.fromkeys(missing)))


def _blind_before_end(course: Course, begin_s: float, end_s: float) -> tuple[float, float] | None:
    """Return the last time without an angle of an incident that ended with less than the hold time of known angles behind it."""
    motion = course.motion
    known_s = motion.time_s[(motion.time_s >= begin_s) & (motion.time_s <= end_s) & np.isfinite(motion.angle_deg)]
    times_s = [begin_s, *known_s.tolist(), end_s]
    blind = [
        each for each in pairwise(times_s) if each[1] - each[0] > GRACE_S and each[1] > end_s - course.hold_s(end_s)
    ]
    return blind[-1] if blind else None


def _peak(course: Course, inside: NDArray[np.bool_]) -> PeakAngle | None:
    motion = course.motion
    known = inside & np.isfinite(motion.angle_deg + motion.u_deg)
    if not known.any():
        return None
    index = int(np.argmax(np.where(known, motion.angle_deg, -np.inf)))
    angle_deg, reach_deg = motion.angle_deg[known], NORMAL_975 * motion.u_deg[known]
    return PeakAngle(
        time_s=float(motion.time_s[index]),
        angle_deg=float(motion.angle_deg[index]),
        u_deg=float(motion.u_deg[index]),
        interval_deg=(max(0.0, float((angle_deg - reach_deg).max())), float((angle_deg + reach_deg).max())),
        azimuth_deg=_finite(motion.azimuth_deg[index]),
    )


def _rises(
    course: Course, incident: AlertIncident, limit_deg: float | None, begin_s: float, end_s: float
) -> tuple[AlertRise, ...]:
    first, *later = incident.rises
    first_s = course.time_s(incident.raised_ns if first is incident.changes[0] else first.time_ns)
    later_s = [time_s for each in later if begin_s < (time_s := course.time_s(each.time_ns)) < end_s]
    is_begin_seen = not incident.is_raised_before and course.time_s(incident.raised_ns) >= course.begin_s
    found = []
    for raised_s, (from_s, to_s) in zip([first_s, *later_s], pairwise([begin_s, *later_s, end_s]), strict=True):
        ends = {"has_begin": from_s == begin_s, "has_end": to_s == end_s}
        angle = _known_angle(course, incident, from_s, to_s, **ends)
        if limit_deg is None:
            found.append(AlertRise(raised_s, angle, None, None))
            continue
        is_first_seen = is_begin_seen or not ends["has_begin"]
        reached_s = _first_at(course, limit_deg, from_s, to_s) if is_first_seen else None
        found.append(AlertRise(raised_s, angle, angle.answer(limit_deg), reached_s))
    return tuple(found)


def _first_at(course: Course, limit_deg: float, begin_s: float, end_s: float) -> float | None:
    """Return the first time of an angle at the limit; None: there is none, or something is missing before it."""
    motion = course.motion
    inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s)
    reached = np.flatnonzero(inside & (motion.angle_deg >= limit_deg))
    if not len(reached) or not course.is_whole(begin_s, float(motion.time_s[reached[0]])):
        return None
    return float(motion.time_s[reached[0]])


def _extremes(course: Course, begin_s: float, end_s: float) -> ForceExtremes | None:
    force_g = course.acceleration.between(begin_s, end_s).force_g
    if not len(force_g) or not np.isfinite(force_g).all():
        return None
    return ForceExtremes(force_g.min(axis=0), force_g.max(axis=0))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def facts_json(evidence: IncidentEvidence, facts: IncidentFacts, verification: RecordVerdict) -> dict[str, Any]:
    """Return what the page states, for programs; null: not known."""
    course, incident = evidence.course, evidence.window.incident
    acknowledged = [
        {
            "by": each.acknowledged_by,
            "reason": each.reason,
            "utc": iso_utc(course.utc_ns(course.time_s(each.time_ns))),
            "level": each.level,
        }
        for each in (incident.acknowledgements if incident else ())
    ]
    utc = {
        name: None if time_s is None else iso_utc(course.utc_ns(time_s))
        for name, time_s in (
            ("raised", facts.raised_s),
            ("level_raised", facts.rises[0].raised_s if facts.rises else None),
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
        "is_whole": not facts.angle.missing,
        "limit_answer": facts.answer,
        "rises": [_rise_json(course, each) for each in facts.rises],
        "largest_deg": None if incident is None else incident.largest_deg,
        "largest_upper_deg": None if incident is None else incident.largest_upper_deg,
        "acknowledged": acknowledged[-1] if acknowledged else None,
        "acknowledgements": acknowledged,
        "searched_to": iso_utc(course.utc_ns(course.checked_s)),
        "peak": None if facts.peak is None else _peak_json(evidence, facts.peak),
        "moves": [
            {
                "state": move.state,
                "from": iso_utc(course.utc_ns(move.begin_s)),
                "to": iso_utc(course.utc_ns(move.end_s)),
                "pivot_accel_m_s2": move.pivot_m_s2,
                "hoist_m_s": move.hoist_m_s,
                "probability": move.probability,
            }
            for move in facts.causes.moves
        ],
        "moves_are_smoothed": facts.peak is not None and facts.causes.live_because is None,
        "unseen_before_peak_s": facts.causes.unseen_s,
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


def _rise_json(course: Course, rise: AlertRise) -> dict[str, Any]:
    return {
        "utc": iso_utc(course.utc_ns(rise.raised_s)),
        "answer": rise.answer,
        "limit_reached": None if rise.reached_s is None else iso_utc(course.utc_ns(rise.reached_s)),
        "coverage95_deg": None if rise.angle.peak is None else list(rise.angle.peak.interval_deg),
        "unknown_s": rise.angle.unknown_s,
    }


def _peak_json(evidence: IncidentEvidence, peak: PeakAngle) -> dict[str, Any]:
    return {
        "utc": iso_utc(evidence.course.utc_ns(peak.time_s)),
        "angle_deg": peak.angle_deg,
        "u_deg": peak.u_deg,
        "coverage95_deg": list(peak.interval_deg),
        "azimuth_deg": peak.azimuth_deg,
    }
