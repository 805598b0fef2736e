"""The report of an incident: a folder with one self-contained HTML page, right on A4 paper, that asks the network for nothing.

The folder is complete, or not there at all.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gateway.documents.environment import render
from gateway.documents.figures import Figure
from gateway.documents.format import format_fixed, format_short, printable_text
from gateway.errors import InputError
from gateway.incident.cause import SmoothMotion
from gateway.incident.cause_sentences import cause_sentences
from gateway.incident.course import Course
from gateway.incident.detail_figures import acceleration_figure, direction_figure, spectrum_figure
from gateway.incident.event_table import event_table
from gateway.incident.evidence import IncidentEvidence, SourceFile, file_sha256, read_evidence
from gateway.incident.facts import IncidentFacts, facts_json, incident_facts
from gateway.incident.incident_selection import AlertIncident, IncidentWindow
from gateway.incident.incident_summary import summary_sentences
from gateway.incident.record_verdict import GENUINE, RecordVerdict, scope_text
from gateway.incident.timeline_figure import ReportClock, timeline_figure
from gateway.messages import Calibration, Health
from gateway.recording.reading.interval import iso_utc
from gateway.recording.reading.timeline import ReportProgress, Timeline, ignore_progress

LEVEL_LABELS = {"trip": ("Trip", "trip"), "warn": ("Warning", "warning")}
NO_ALERT, ALERT_OF_NO_LEVEL = ("No alert", "none"), ("Alert, its level not recorded", "warning")
Pairs = tuple[tuple[str, str], ...]
PAGE_FILE, CUT_FILE, FACTS_FILE = "incident.html", "incident.mcap", "incident.json"
Verify = Callable[[Sequence[Path]], RecordVerdict]
"""Takes the files of which the report is made."""


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
    label, kind = NO_ALERT if incident is None else LEVEL_LABELS.get(incident.level, ALERT_OF_NO_LEVEL)
    label = label if incident is None else f"{label}, {incident.rule}"
    if verification.kind == "differs":
        label, kind = f"{verification.alarm}: {label}", "trip"
    configuration, since = configuration_in_force(course, incident)
    return render(
        "incident.html.j2",
        title=f"Incident report: {', '.join(filter(None, (course.source, evidence.gateway)))}",
        label=": ".join(filter(None, (course.source, label))),
        kind=kind,
        sentences=summary_sentences(course, incident, facts, evidence.window),
        identity=_identity(evidence),
        timeline=timeline_figure(course, incident, facts),
        details=_figures(evidence, facts),
        direction=direction_figure(course, facts),
        events=event_table(evidence),
        is_shortened=evidence.window.is_shortened,
        verification=verification,
        cause=cause,
        moved=tuple(cause_sentences(ReportClock(course), facts)),
        sources=tuple(_source_row(source, course.wall_offset_ns) for source in evidence.sources),
        remarks=evidence.remarks,
        losses=tuple((source.path.name, ", ".join(source.losses)) for source in evidence.sources if source.losses),
        cut=cut,
        health=_health(course.last_health),
        device=tuple((name, printable_text(value, 200)) for name, value in evidence.device.items()),
        calibrations=tuple((each, *_certificate(evidence, each)) for _, each in course.calibrations),
        configuration=configuration,
        configuration_since=since,
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
            "No spectrum: too few samples, too many of them missing or off the rope, or no calibration.",
        ),
    )


def _identity(evidence: IncidentEvidence) -> Pairs:
    course, clock = evidence.course, ReportClock(evidence.course)
    incident = evidence.window.incident
    return (
        ("Site / crane / sensor", f"{evidence.gateway}{f' ({course.source})' if course.source else ''}"),
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
        ("State as last stated", f"{health.state}, at {iso_utc(health.time_ns)}"),
        ("Device", f"{health.device_kind} {health.device_id or 'unknown'}"),
        ("Measured rate", rate),
        ("Samples since start", f"{health.samples}, {health.lost} lost, {health.invalid} invalid"),
        ("Faults since start", faults),
        ("Running for", f"{health.uptime_s / 3600:.2f} h, boot {health.boot_id}"),
        ("Disk, processor", f"{_number(health.disk_free_mb)} MB free, {_number(health.cpu_percent)} % in use"),
        ("Software", health.software),
    )


def configuration_in_force(course: Course, incident: AlertIncident | None) -> tuple[str, str]:
    """Return the configuration in force when the alert was highest, or at the end without one, and from when on; empty: none."""
    decisive_s = course.end_s if incident is None else course.time_s(incident.highest.time_ns)
    known = course.configurations
    if not known:
        return "", ""
    place = max((i for i, each in enumerate(known) if each.time_s <= decisive_s), default=0)
    clock, chosen = ReportClock(course), known[place]
    if len(known) == 1:
        return chosen.toml, "In force throughout this report."
    since = f"from {clock.both(chosen.time_s)} on" if place else "from before this report"
    until = f" to {clock.both(known[place + 1].time_s)}" if place + 1 < len(known) else ""
    when = "at the end of this report" if incident is None else "when the alert was at its highest level"
    return chosen.toml, f"In force {when}, {since}{until}; what others changed is among the events."


def _number(value: float | None) -> str:
    return "unknown" if value is None else format_fixed(value, 0)


def _certificate(evidence: IncidentEvidence, calibration: Calibration) -> tuple[str, str]:
    """Return name and content of the certificate of a calibration; empty ones where the recordings have none."""
    identity = str(calibration.record.get("id", ""))
    name = next((each for each in evidence.certificates if identity and identity in each), "")
    return name, evidence.certificates.get(name, b"").decode(errors="replace")


AnalyseCause = Callable[[Path], CauseAnalysis]
"""Takes the recording that was cut out, and writes its own report beside it."""


@dataclass(frozen=True, slots=True)
class IncidentReport:
    """The report that was written."""

    folder: Path
    sentences: tuple[str, ...]
    """The summary."""
    verification: RecordVerdict
    content: dict[str, Any]
    """The numbers, as in the file FACTS_FILE."""


def write_report(
    timeline: Timeline,
    window: IncidentWindow,
    folder: Path,
    *,
    verify: Verify,
    computed: Mapping[str, str],
    analyse: AnalyseCause | None = None,
    smooth: SmoothMotion | None = None,
    report: ReportProgress = ignore_progress,
) -> IncidentReport:
    """Write the page, its numbers as JSON, the recording that was cut out, and the certificates, into a new folder.

    `computed` states when and how the report was made, `smooth` what moved the load. Raises `RecordingError`, and `InputError`
    where the folder exists or cannot be written; nothing is left behind then.
    """
    try:
        with _new_folder(folder) as partial:
            with (partial / CUT_FILE).open("wb") as stream:
                evidence = read_evidence(timeline, window, stream, report)
            verification = verify([source.path for source in evidence.sources])
            scope = scope_text(len(evidence.sources), len(timeline.segments), verification)
            if evidence.course.source:  # nothing simulated is called genuine
                verification = replace(verification, label=verification.label.removeprefix(GENUINE))
            facts = incident_facts(evidence.course, window.incident, partial / CUT_FILE, smooth)
            alterable = _alterable_peak(evidence.course, facts, verification)
            verification = replace(verification, scope=f"{scope}{alterable}")
            page = render_page(
                evidence,
                facts,
                verification=verification,
                cause=None if analyse is None else analyse(partial / CUT_FILE),
                cut=(("File", CUT_FILE), ("SHA-256", file_sha256(partial / CUT_FILE))),
                computed=tuple(computed.items()),
            )
            (partial / PAGE_FILE).write_text(page, encoding="utf-8")
            content = facts_json(evidence, facts, verification)
            (partial / FACTS_FILE).write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            for name, certificate in evidence.certificates.items():
                (partial / Path(name).name).write_bytes(certificate)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another --out") from error
    sentences = summary_sentences(evidence.course, window.incident, facts, window)
    return IncidentReport(folder, sentences, verification, content)


def _alterable_peak(course: Course, facts: IncidentFacts, verification: RecordVerdict) -> str:
    """Return that the largest angle was not signed while the gateway ran; empty: it was, or is not known."""
    if facts.peak is None:
        return ""
    peak_ns = course.gateway_ns(facts.peak.time_s)
    for end in verification.alterable:
        if end.from_ns < peak_ns <= end.to_ns:
            length = f"{format_fixed((end.to_ns - end.from_ns) / 1e9, 1)} s"
            return f" The largest angle lies in the {length} {end.words}: who could write to the files then could change it."
    return ""


@contextmanager
def _new_folder(folder: Path) -> Iterator[Path]:
    """Yield a hidden folder that becomes `folder` at the end of the block; after an error nothing is left."""
    if folder.exists():
        raise InputError(f"{folder}: exists; choose another --out, so that no earlier report is lost")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"{folder}: there is no folder {folder.parent}; make it, or choose another --out")
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    try:
        yield partial
        partial.rename(folder)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
