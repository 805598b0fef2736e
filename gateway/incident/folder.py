"""The folder of an incident report: complete, or not there at all."""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gateway.errors import InputError
from gateway.incident.evidence import file_sha256, read_evidence
from gateway.incident.facts import facts_json, incident_facts
from gateway.incident.incident_page import CauseAnalysis, render_page
from gateway.incident.incident_selection import IncidentWindow
from gateway.incident.incident_summary import summary_sentences
from gateway.incident.recording_verdict import RecordVerdict
from gateway.recording.reading.timeline import ReportProgress, Timeline, ignore_progress

PAGE_FILE, CUT_FILE, FACTS_FILE = "incident.html", "incident.mcap", "incident.json"

Verify = Callable[[Sequence[Path]], RecordVerdict]
"""Takes the files of which the report is made."""
AnalyseCause = Callable[[Path], CauseAnalysis]
"""Takes the recording that was cut out, and writes its own report beside it."""


@dataclass(frozen=True, slots=True)
class IncidentReport:
    """The report that was written."""

    folder: Path
    sentences: tuple[str, ...]
    """The summary."""
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
    report: ReportProgress = ignore_progress,
) -> IncidentReport:
    """Write the page, its numbers as JSON, the recording that was cut out, and the certificates, into a new folder.

    `computed` states when and how the report was made. Raises `RecordingError`, and `InputError` where the folder exists or
    cannot be written; nothing is left behind then.
    """
    try:
        with _new_folder(folder) as partial:
            with (partial / CUT_FILE).open("wb") as stream:
                evidence = read_evidence(timeline, window, stream, report)
            verification = verify([source.path for source in evidence.sources])
            facts = incident_facts(evidence.course, window.incident)
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
    return IncidentReport(folder, summary_sentences(evidence.course, window.incident, facts), content)


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
