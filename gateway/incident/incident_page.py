"""The report of an incident: one self-contained HTML page, right on A4 paper. It asks the network for nothing."""

from dataclasses import dataclass

from gateway.documents.environment import render
from gateway.documents.figures import Figure
from gateway.documents.format import format_fixed, format_short, printable_text
from gateway.incident.detail_figures import acceleration_figure, direction_figure, spectrum_figure
from gateway.incident.event_table import event_table
from gateway.incident.evidence import IncidentEvidence, SourceFile
from gateway.incident.facts import IncidentFacts
from gateway.incident.incident_summary import summary_sentences
from gateway.incident.recording_verdict import RecordVerdict
from gateway.incident.timeline_figure import ReportClock, timeline_figure
from gateway.messages import Calibration, Health
from gateway.recording.reading.interval import iso_utc

LEVEL_LABELS = {"trip": ("Trip", "trip"), "warn": ("Warning", "warning")}
NO_ALERT = ("No alert", "none")
Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class CauseAnalysis:
    """What `reconcile` says of the incident."""

    sentence: str
    report: str
    """Name of its report in the same folder."""


def render_page(
    evidence: IncidentEvidence,
    facts: IncidentFacts,
    *,
    verification: RecordVerdict,
    cause: CauseAnalysis | None,
    cut: Pairs,
    computed: Pairs,
) -> str:
    """Return the page; `cut` states name and hash of the recording that was cut out, `computed` how the report was made."""
    course, incident = evidence.course, evidence.window.incident
    label, kind = NO_ALERT if incident is None else LEVEL_LABELS.get(incident.level, NO_ALERT)
    return render(
        "incident.html.j2",
        title=f"Incident report: {evidence.gateway}",
        label=label if incident is None else f"{label}, {incident.rule}",
        kind=kind,
        sentences=summary_sentences(course, incident, facts),
        identity=_identity(evidence),
        timeline=timeline_figure(course, incident, facts),
        details=_figures(evidence, facts),
        direction=direction_figure(course, facts),
        events=event_table(evidence),
        is_shortened=evidence.window.is_shortened,
        verification=verification,
        cause=cause,
        sources=tuple(_source_row(source, course.wall_offset_ns) for source in evidence.sources),
        remarks=evidence.remarks,
        losses=tuple((source.path.name, ", ".join(source.losses)) for source in evidence.sources if source.losses),
        cut=cut,
        health=_health(course.last_health),
        device=tuple((name, printable_text(value, 200)) for name, value in evidence.device.items()),
        calibrations=tuple((each, *_certificate(evidence, each)) for _, each in course.calibrations),
        configuration=evidence.configuration_toml or "",
        computed=computed,
    )


def _figures(evidence: IncidentEvidence, facts: IncidentFacts) -> tuple[tuple[str, Figure | None, str], ...]:
    """Return (title, figure, what to say where there is none)."""
    return (
        (
            "Acceleration around the largest angle",
            acceleration_figure(evidence.course, facts),
            "There are no samples around the largest angle.",
        ),
        (
            "Spectrum",
            spectrum_figure(evidence.course, facts),
            "No spectrum: too few samples, too many of them missing, or no calibration.",
        ),
    )


def _identity(evidence: IncidentEvidence) -> Pairs:
    course, clock = evidence.course, ReportClock(evidence.course)
    incident = evidence.window.incident
    return (
        ("Site / crane / sensor", evidence.gateway),
        ("Incident", "none" if incident is None else f"{incident.id}, no. {incident.number} of these recordings"),
        ("From", clock.both(course.begin_s)),
        ("To", clock.both(course.end_s)),
    )


def _source_row(source: SourceFile, wall_offset_ns: int) -> tuple[str, str, str, str, str]:
    span = f"{iso_utc(source.from_ns + wall_offset_ns)} to {iso_utc(source.to_ns + wall_offset_ns)}"
    size = f"{source.size_bytes / 1e6:.2f} MB"
    return source.path.name, span, size, f"{source.software}, boot {source.boot_id}", source.sha256


def _health(health: Health | None) -> Pairs:
    if health is None:
        return ()
    counts = {**health.faults, **{f"dropped {name}": count for name, count in health.dropped.items() if count}}
    faults = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in counts.items()) or "none"
    rate = "not known" if health.measured_rate_hz is None else f"{format_short(health.measured_rate_hz, 6)} Hz"
    return (
        ("State at the end", health.state),
        ("Device", f"{health.device_kind} {health.device_id or 'unknown'}"),
        ("Measured rate", rate),
        ("Samples since start", f"{health.samples}, {health.lost} lost, {health.invalid} invalid"),
        ("Faults since start", faults),
        ("Running for", f"{health.uptime_s / 3600:.2f} h, boot {health.boot_id}"),
        ("Disk, processor", f"{_number(health.disk_free_mb)} MB free, {_number(health.cpu_percent)} % in use"),
        ("Software", health.software),
    )


def _number(value: float | None) -> str:
    return "unknown" if value is None else format_fixed(value, 0)


def _certificate(evidence: IncidentEvidence, calibration: Calibration) -> tuple[str, str]:
    """Return name and content of the certificate of a calibration; empty ones where the recordings have none."""
    identity = str(calibration.record.get("id", ""))
    name = next((each for each in evidence.certificates if identity and identity in each), "")
    return name, evidence.certificates.get(name, b"").decode(errors="replace")
