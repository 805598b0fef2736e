"""`plumbline record incident`: a report of one incident."""

import argparse
import shlex
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero, recording_time
from gateway.cli.command import command, one_of, option
from gateway.cli.output import JSON_OPTION
from gateway.cli.record.known_key import KEY_OPTION, key_of_recordings
from gateway.cli.recording_options import CA_OPTION, PATHS_OPTION
from gateway.errors import ANSWER_IS_NO, WITH_LOSSES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gateway.incident.cause import MotionAroundPeak
    from gateway.incident.incident_report import CauseAnalysis
    from gateway.incident.incident_selection import AlertIncident, IncidentChoice, IncidentWindow
    from gateway.recording.reading.timeline import Timeline

ALERT_MARGIN_S = 60.0
"""Time before and after an alert. Basis: a choice; some swings, so that its cause is seen."""
REPORT = "cause.html"
EXIT_CODES = {"genuine": 0, "differs": ANSWER_IS_NO, "open": WITH_LOSSES}
"""Definition: exit codes of the verdicts on the recordings, those of `record verify`."""


@command(
    "incident",
    "write a report of an incident: one page with figures, and the recording of it",
    "Write a report of an incident into a new folder: a page with a summary, a timeline and figures, and the "
    "part of the recordings that it is made from. Without a choice, of the last incident. The files that it is made from, and no "
    "others, are checked as by `record verify`, with the same exit codes: 0 genuine; 1 they differ from what was signed; 3 "
    "consistent in themselves only, because no key is known, or nothing is signed, or the end of a file is not, or an extract. "
    "The report is written in each case.",
    "example: plumbline record incident plumbline-data --last --out crane-1-trip",
    PATHS_OPTION,
    one_of(
        option(
            "--around",
            type=recording_time,
            metavar="TIME",
            help="the incident around a time: UTC (2026-11-22T07:30:00Z, or 07:30:05 on the first day), or seconds "
            "from the start",
        ),
        option("--alert", metavar="N", help="incident number N, in order of time, from 1, or its id"),
        option("--last", action="store_true", help="the last incident"),
        option("--list", action="store_true", help="only print the incidents with their numbers"),
    ),
    *(
        option(
            f"--{name}",
            dest=f"{name}_time",
            type=recording_time,
            metavar="TIME",
            help=f"{what} of the report, in place of a choice and --margin; in the same forms",
        )
        for name, what in (("from", "begin"), ("to", "end"))
    ),
    option(
        "--margin",
        type=above_zero,
        default=ALERT_MARGIN_S,
        metavar="S",
        help="seconds before and after the incident (60)",
    ),
    option("--local", action="store_true", help="read --around, --from and --to in this computer's time zone"),
    option("--out", type=Path, metavar="FOLDER", help="the new folder; without it incident-<UTC> in the present one"),
    option(
        "--reconcile",
        action="store_true",
        help="also fit a simulation of the crane, which names what moved the load; takes minutes",
    ),
    KEY_OPTION,
    CA_OPTION,
    JSON_OPTION,
)
def run_incident(arguments: argparse.Namespace) -> int:
    """Write the report, or list the incidents."""
    from gateway.cli.progress import ProgressBar
    from gateway.extras import require_extra, require_plots
    from gateway.incident.incident_selection import choose_window, read_incidents
    from gateway.recording.reading.timeline import open_timeline

    choice = _choice(arguments)
    timeline = open_timeline(arguments.paths)
    hidden: list[str] = []
    with ProgressBar("looking for alerts") as bar:
        incidents = read_incidents(timeline, bar.update, hidden)
    if arguments.list:
        return _list(arguments, timeline, incidents, hidden)
    window = replace(choose_window(timeline, incidents, choice, arguments.margin), hidden=tuple(hidden))
    require_plots()
    if arguments.reconcile:
        require_extra("twin")
    return _write(arguments, timeline, window)


def _choice(arguments: argparse.Namespace) -> "IncidentChoice":
    from gateway.cli.recording_options import in_zone
    from gateway.errors import InputError
    from gateway.incident.incident_selection import IncidentChoice
    from gateway.recording.reading.interval import RecordingInterval

    given = (arguments.around, arguments.from_time, arguments.to_time)
    around, begin, end = (in_zone(time, arguments.local) for time in given)
    if begin is None and end is None:
        return IncidentChoice(around, arguments.alert)
    if around is not None or arguments.alert is not None or arguments.last or arguments.list:
        raise InputError(
            "--from and --to: take the place of --around, --alert, --last and --list; give them, or one of those"
        )
    return IncidentChoice(interval=RecordingInterval(begin, end))


def _list(
    arguments: argparse.Namespace, timeline: "Timeline", incidents: "Sequence[AlertIncident]", hidden: "Sequence[str]"
) -> int:
    """Print the incidents with their numbers, and what hides others."""
    from gateway.cli.output import show
    from gateway.recording.chain.missing_files import missing_of
    from gateway.recording.reading.interval import iso_utc

    offset_ns = timeline.span().wall_offset_ns
    rows = [
        {
            "number": each.number,
            "incident": each.id,
            "rule": each.rule,
            "level": each.level,
            "raised": iso_utc(each.raised_ns + offset_ns),
            "is_raised_before": each.is_raised_before,
            "cleared": None if each.cleared_ns is None else iso_utc(each.cleared_ns + offset_ns),
        }
        for each in incidents
    ]
    lines = [
        f"{row['number']:>4}  {'before' if row['is_raised_before'] else '':<7}{row['raised']}  {row['rule']:<12}"
        f"{row['level']:<5} {row['incident']}, "
        f"{_end_text(incident, row['cleared'])}"
        for incident, row in zip(incidents, rows, strict=True)
    ]
    lines = lines or ["no alert was raised"]
    if hidden:
        lines += ["", "not all is here, others may have been, and the numbers may be other than in the originals:"]
        lines += [f"  {each}" for each in hidden]
    elif missing_of(timeline).untold:
        lines += ["", "those in files that are not given, or that somebody has removed, are not among these"]
    show("\n".join(lines), rows, arguments.json)
    return WITH_LOSSES if hidden else 0


def _end_text(incident: "AlertIncident", cleared: object) -> str:
    if incident.is_acknowledgement_alone:
        return "only an acknowledgement is in the recordings"
    return "not cleared in the recordings" if cleared is None else f"cleared {cleared}"


def _write(arguments: argparse.Namespace, timeline: "Timeline", window: "IncidentWindow") -> int:
    from gateway import __version__
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar
    from gateway.incident.incident_report import PAGE_FILE, write_report
    from gateway.incident.record_verdict import judge_recordings
    from gateway.recording.chain.missing_files import missing_of
    from gateway.recording.format.content import segment_number

    known = key_of_recordings(arguments.key, arguments.ca, [segment.path for segment in timeline.segments])
    refusal = None if known.vouched is None else known.vouched.refusal
    made = datetime.now(tz=UTC)
    origin = datetime.fromtimestamp((window.origin_ns + timeline.span().wall_offset_ns) / 1e9, tz=UTC)
    newest, missing = timeline.segments[-1].path, missing_of(timeline)
    numbers = {segment.path: segment_number(segment.origin) for segment in timeline.segments}
    folder = arguments.out or Path(f"incident-{origin:%Y%m%dT%H%M%SZ}")
    with ProgressBar("reading the incident") as bar:
        written = write_report(
            timeline,
            window,
            folder,
            verify=lambda paths: judge_recordings(
                paths,
                known.public_key,
                said_by=known.said_by,
                refusal=refusal,
                ends_in=newest.parent if newest in paths and newest.parent in timeline.given.folders else None,
                folders=timeline.given.folders if len(paths) == len(timeline.segments) else (),
                is_extract=bool(missing.untold),
                beside=missing.beside({numbers[path] for path in paths}, set(numbers.values())),
                elsewhere=missing.problems,
            ),
            computed={
                "Made by": f"plumbline {__version__}",
                "Made at": f"{made:%Y-%m-%d %H:%M:%S} UTC",
                "Command": shlex.join(["plumbline", *sys.argv[1:]]),
            },
            analyse=analyse_cause if arguments.reconcile else None,
            smooth=smooth_motion,
            report=bar.update,
        )
    verdict = written.verification
    lines = [*written.sentences, "", verdict.line, *(f"  {text}" for text in (*verdict.problems, known.remark) if text)]
    lines.append(f"report: {folder / PAGE_FILE}")
    show("\n".join(lines), written.content, arguments.json)
    return EXIT_CODES[written.verification.kind]


def smooth_motion(recording: Path, begin_ns: int, end_ns: int) -> "MotionAroundPeak | None":
    """Return the motion of a recording between two gateway times as `measure` states it; None: it cannot be known.

    Raises `InputError` and `RecordingError` where the recording does not describe the crane.
    """
    from gateway.incident.cause import MotionAroundPeak
    from gateway.measurement.measure import measure
    from gateway.measurement.source import read_source
    from gateway.recording.reading.interval import RecordingInterval, RecordingTime
    from gateway.recording.reading.timeline import open_timeline

    first_ns = open_timeline([recording]).span().first_ns
    begin, end = (RecordingTime("", each - first_ns, "first_sample") for each in (begin_ns, end_ns))
    source = read_source([recording], None, RecordingInterval(begin, end))
    motion = measure(source, with_motion=True).motion
    if motion is None or source.recording.origin_ns is None:
        return None
    return MotionAroundPeak(source.recording.origin_ns, motion.history, motion.doubt)


def analyse_cause(recording: Path) -> "CauseAnalysis":
    """Fit the simulation to a recording, write the report of it into the same folder, and return the answer in a sentence.

    Raises `InputError` and `RecordingError` where the recording does not describe the crane.
    """
    from gateway import __version__
    from gateway.cli.progress import Progress
    from gateway.documents.format import as_sentence
    from gateway.incident.incident_report import CauseAnalysis
    from gateway.measurement.source import read_source
    from gateway.twin.reconcile.data.data_checks import check_recording, model_from_recording
    from gateway.twin.reconcile.output.serialisation import VERDICT_SENTENCES
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
    names = result.alternatives or tuple(effect.name for effect in result.effects)
    found = f"{VERDICT_SENTENCES[result.verdict]} {', '.join(names)}".strip()
    return CauseAnalysis(f"Against a free swing in the simulation: {found}. {as_sentence(result.reason)}", REPORT)
