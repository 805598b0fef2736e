"""The numbers of a report as JSON."""

from typing import Any

from gateway.incident.evidence import IncidentEvidence
from gateway.incident.facts import IncidentFacts, PeakAngle
from gateway.incident.verdict import RecordVerdict
from gateway.messages import SCHEMA_VERSION
from gateway.recording.reading.interval import iso_utc


def facts_json(evidence: IncidentEvidence, facts: IncidentFacts, verification: RecordVerdict) -> dict[str, Any]:
    """Return what the page states, for programs; null: not known."""
    course, incident = evidence.course, evidence.window.incident
    utc = {
        name: None if time_s is None else iso_utc(course.utc_ns(time_s))
        for name, time_s in (
            ("raised", facts.raised_s),
            ("cleared", facts.cleared_s),
            ("limit_reached", facts.reached_s),
            ("from", course.begin_s),
            ("to", course.end_s),
        )
    }
    return {
        "schema_version": SCHEMA_VERSION,
        "gateway": evidence.gateway,
        "incident": None if incident is None else incident.id,
        "number": None if incident is None else incident.number,
        "rule": None if incident is None else incident.rule,
        "level": None if incident is None else incident.level,
        "limit_deg": None if incident is None else incident.highest.limit_deg,
        "clear_deg": None if incident is None else incident.highest.clear_deg,
        "raised_by_bound": None if incident is None else incident.highest.is_bound,
        "utc": utc,
        "acknowledged": _acknowledgement(evidence),
        "peak": None if facts.peak is None else _peak(evidence, facts.peak),
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
        },
        "calibration_ids": [calibration.calibration_id for _, calibration in course.calibrations],
        "verification": {
            "verdict": verification.kind,
            "text": verification.label,
            "remarks": list(verification.sentences),
        },
        "sources": [{"file": source.path.name, "sha256": source.sha256} for source in evidence.sources],
    }


def _acknowledgement(evidence: IncidentEvidence) -> dict[str, Any] | None:
    incident = evidence.window.incident
    known = None if incident is None else incident.acknowledgement
    if known is None:
        return None
    time_s = (known.time_ns - evidence.course.origin_ns) / 1e9
    return {"by": known.acknowledged_by, "reason": known.reason, "utc": iso_utc(evidence.course.utc_ns(time_s))}


def _peak(evidence: IncidentEvidence, peak: PeakAngle) -> dict[str, Any]:
    return {
        "utc": iso_utc(evidence.course.utc_ns(peak.time_s)),
        "angle_deg": peak.angle_deg,
        "u_deg": peak.u_deg,
        "coverage95_deg": list(peak.interval_deg),
        "azimuth_deg": peak.azimuth_deg,
    }
