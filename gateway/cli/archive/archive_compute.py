"""`plumbline archive verify`, `replay`, `measure` and `reconcile`: commands of one machine over all recordings of an archive.

`replay --against-version` compares what two versions of the program would have shown to an operator.
"""

import argparse
import os
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway import __version__
from gateway.cli.archive.archive_index import SOURCE_OPTION, table_option
from gateway.cli.argument_types import above_zero, whole_number
from gateway.cli.command import AddTo, Command, option
from gateway.cli.output import JSON_OPTION
from gateway.errors import ANSWER_IS_NO
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.archive.alternatives import OutcomeChange, ReplayChange, VersionComparison
    from gateway.archive.compute import ComputeResult
    from gateway.archive.tables import Archive
    from gateway.archive.tasks import TaskKind
    from gateway.calibration.record import CalibrationRecord
    from gateway.recording.format.summary_builder import RecordedAlert

AS_RECORDED = ""
"""Of --against-version: compare with what was recorded. Definition: no version is named so."""
MEMORY_MB, TIME_MINUTES = 4096, 60.0
"""Limits of a task. Basis: a choice; numerical libraries reserve a gigabyte, and a day of one crane is replayed in 40 minutes."""
TASK_OPTIONS = (
    SOURCE_OPTION,
    table_option(),
    option("--processes", type=whole_number, metavar="N", help="tasks at once on this machine (default: its cores)"),
    option(
        "--cluster",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster, such as tcp://10.0.0.2:8786 (default: this machine)",
    ),
    option(
        "--memory-mb",
        type=whole_number,
        default=MEMORY_MB,
        metavar="MB",
        help="address space of a task (%(default)s)",
    ),
    option("--minutes", type=above_zero, default=TIME_MINUTES, metavar="MIN", help="time of a task (%(default)g)"),
    option("--again", action="store_true", help="also what failed before"),
)
COMPARISON_OPTIONS = (
    option(
        "--calibration",
        type=Path,
        metavar="RECORD.json",
        help="compute with this record in place of the recorded ones, where the recordings are of its device",
    ),
    option(
        "--against-version",
        dest="against",
        nargs="?",
        const=AS_RECORDED,
        metavar="VERSION",
        help="then state what an operator would have seen otherwise than by this version of the program, of which the table has "
        "replays, or, without a version, than was recorded: alerts missed and added first, then angles",
    ),
)
MAX_LISTED = 20
"""Starts that are printed. Basis: a choice; a screen or two, and the JSON has all."""


def _run(kind: "TaskKind", arguments: argparse.Namespace) -> int:
    require_extra("archive")
    if kind == "reconcile":
        require_extra("twin")
    if arguments.cluster is not None:
        require_extra("cluster")
    from gateway.archive.compute import Workers, compute
    from gateway.archive.source import open_source
    from gateway.archive.tables import Archive
    from gateway.archive.tasks import TaskLimits
    from gateway.calibration.input_files import read_record
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar

    calibration = None if kind != "replay" or arguments.calibration is None else read_record(arguments.calibration)
    open_source(arguments.source)  # what cannot be read is told before anything is begun
    workers = Workers(max(1, arguments.processes or len(os.sched_getaffinity(0))), arguments.cluster)
    limits = TaskLimits(60 * arguments.minutes, arguments.memory_mb)
    archive = Archive(arguments.table)
    with ProgressBar(f"archive {kind}") as bar:
        result = compute(
            archive,
            arguments.source,
            kind,
            workers,
            limits,
            calibration=calibration,
            again=arguments.again,
            report=bar.update,
        )
    text, content = _text(result), _as_json(result)
    if kind == "replay" and arguments.against is not None:
        told, changes = _compared(archive, arguments.against, calibration)
        text, content = f"{text}\n{told}", content | {"changes": changes}
    show(text, content, arguments.json)
    return ANSWER_IS_NO if result.failed else 0


def _compared(archive: "Archive", against: str, calibration: "CalibrationRecord | None") -> tuple[str, dict[str, Any]]:
    """Compare what this version has computed, as text and as JSON."""
    from gateway.archive.alternatives import compare_replays
    from gateway.archive.query import open_database
    from gateway.cli.archive.archive_compute import changes_json, changes_text

    record = None if calibration is None else calibration.id
    with open_database(archive, ("recordings", "results")) as database:
        found = compare_replays(
            database, against or None, "software = ? AND calibration IS NOT DISTINCT FROM ?", [__version__, record]
        )
    before = f"by version {against}" if against else "as recorded"
    after = f"by version {__version__}" + (f" with calibration {record}" if record else "")
    return changes_text(found, before, after), changes_json(found)


def _text(result: "ComputeResult") -> str:
    lines = [f"{task.files[0].row.path}: {outcome.state}: {outcome.reason}" for task, outcome in result.failed]
    told = ", ".join(f"{count} {verdict}" for verdict, count in sorted(result.verdicts.items())) or "nothing to do"
    return "\n".join([*lines, f"{result.planned} tasks, {result.known} had an answer: {told}"])


def _as_json(result: "ComputeResult") -> dict[str, Any]:
    return {
        "planned": result.planned,
        "known": result.known,
        "verdicts": dict(result.verdicts),
        "failed": [
            {"path": task.files[0].row.path, "state": outcome.state, "reason": outcome.reason}
            for task, outcome in result.failed
        ],
    }


def _task_verb(kind: "TaskKind", what: str, program: str, *options: AddTo) -> Command:
    """Return the verb that runs the command `program` of one machine as tasks."""
    return Command(
        name=kind,
        help=what,
        description=f"{what[0].upper()}{what[1:]}: run plumbline {program} over the indexed recordings of a source, in "
        "processes of this machine or of a cluster, and put the answers into the table results. What has an answer is not "
        "done again. Exit code 1: a task has failed, with the reason.",
        epilog=f"example: plumbline archive {kind} /srv/recordings --table /srv/archive --processes 4",
        options=[*TASK_OPTIONS, *options, JSON_OPTION],
        run=partial(_run, kind),
    )


verify = _task_verb(
    "verify", "check the chain of each gateway: nothing changed, removed, exchanged or forged", "record verify"
)
replay = _task_verb(
    "replay",
    "compute every start of each gateway again, and compare it with what was recorded",
    "record replay",
    *COMPARISON_OPTIONS,
)
measure = _task_verb("measure", "measure each recording offline", "measure")
reconcile = _task_verb("reconcile", "fit the simulation to each recording, and name what it lacks", "reconcile")


def changes_text(found: "VersionComparison", before: str, after: str) -> str:
    """Return the starts that differ, those first in which an operator would have noticed most."""
    return "\n".join(_lines(found, before, after))


def _lines(found: "VersionComparison", before: str, after: str) -> Iterator[str]:
    yield f"{found.compared} starts, {before} and {after}: an operator would have seen {len(found.changes)} otherwise"
    for change in found.changes[:MAX_LISTED]:
        yield f"{change.gateway} from {change.utc:%Y-%m-%d %H:%M:%S} UTC ({change.path})"
        yield from (f"    {line}" for line in _change_lines(change.change))
    if len(found.changes) > MAX_LISTED:
        yield f"and {len(found.changes) - MAX_LISTED} with less; --json has all"
    if found.not_compared:
        yield f"{found.not_compared} starts have no answer of both; run plumbline archive replay by the other version, too"


def _change_lines(change: "OutcomeChange") -> Iterator[str]:
    yield from (f"missed {_alert(alert)}" for alert in change.missed)
    yield from (f"added  {_alert(alert)}" for alert in change.added)
    yield from (f"{after.level} in place of a {_alert(before)}" for before, after in change.other_level)
    yield "largest angle " + " -> ".join("none" if each is None else f"{each:.3f} deg" for each in change.angle_deg)
    if change.unknown_s[0] != change.unknown_s[1]:
        yield "swing unknown " + " -> ".join(f"{each:.1f} s" for each in change.unknown_s)


def _alert(alert: "RecordedAlert") -> str:
    from gateway.recording.reading.interval import iso_utc

    largest = "" if alert.largest_deg is None else f", {alert.largest_deg:.2f} deg at most"
    return f"{alert.level} of rule {alert.rule} at {iso_utc(alert.from_utc_ns)}{largest}"


def changes_json(found: "VersionComparison") -> dict[str, Any]:
    """Return the comparison as JSON."""
    return {
        "compared": found.compared,
        "not_compared": found.not_compared,
        "changed": [_change_json(change) for change in found.changes],
    }


def _change_json(change: "ReplayChange") -> dict[str, Any]:
    content: dict[str, Any] = asdict(change)
    return {**content.pop("change"), **content, "utc": change.utc.isoformat()}
