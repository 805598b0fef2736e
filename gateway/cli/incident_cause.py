"""What moved the load, by `reconcile`, for the report of an incident."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gateway.incident.incident_page import CauseAnalysis

REPORT = "cause.html"


def analyse_cause(recording: Path) -> "CauseAnalysis":
    """Fit the simulation to a recording, write the report of it into the same folder, and return the answer in a sentence.

    Raises `InputError` and `RecordingError` where the recording does not describe the crane.
    """
    from gateway import __version__
    from gateway.cli.progress import Progress
    from gateway.documents.text import as_sentence
    from gateway.incident.incident_page import CauseAnalysis
    from gateway.measurement.source import read_source
    from gateway.twin.reconcile.data.data_checks import check_recording, model_from_recording
    from gateway.twin.reconcile.output.text import VERDICT_SENTENCES
    from gateway.twin.reconcile.reconcile import reconcile
    from gateway.twin.report.page import render_report

    begin_s = time.monotonic()
    source = read_source([recording], None)
    model = model_from_recording(source)
    with Progress() as progress:
        result = reconcile(model, check_recording(source, model.rig), None, tick=progress.tick)
    page = render_report(
        result,
        title="What moved the load",
        software=f"plumbline {__version__}",
        computed={"recording": recording.name, "time": f"{time.monotonic() - begin_s:.1f} s"},
    )
    (recording.parent / REPORT).write_text(page, encoding="utf-8")
    names = result.candidates or tuple(effect.name for effect in result.effects)
    found = f"{VERDICT_SENTENCES[result.verdict]} {', '.join(names)}".strip()
    return CauseAnalysis(f"Against a free swing in the simulation: {found}. {as_sentence(result.reason)}", REPORT)
