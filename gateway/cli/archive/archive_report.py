"""`plumbline archive report`: a page on the swings of a fleet."""

import argparse
from datetime import UTC, datetime, time, timedelta
from typing import TYPE_CHECKING, Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from gateway.cli.archive.archive_index import day, table_option
from gateway.cli.argument_types import above_zero, parsed_by
from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION, output_file
from gateway.extras import require_extra, require_plots

if TYPE_CHECKING:
    from gateway.archive.report import ArchiveReport

DEFAULT_DAYS = 30
"""Days of a report. Definition: about a month."""


def _shifts(text: str) -> tuple[time, ...]:
    try:
        return tuple(time.fromisoformat(each.strip()) for each in text.split(","))
    except ValueError:
        raise ValueError(f"{text} are no times such as 06:00,14:00,22:00") from None


def _zone(text: str) -> str:
    try:
        return ZoneInfo(text).key
    except (ZoneInfoNotFoundError, ValueError):
        raise ValueError(f"{text} is no time zone such as Europe/Berlin") from None


@command(
    "report",
    "write a page: exceedances by crane, hour and shift, worst swings, calibrations, availability, other limits",
    "Write a page on the swings of a fleet: exceedances by crane, hour and shift, the worst swings with the "
    "command that opens each, age and drift of the calibrations, availability and why the swing was not known, and what "
    "other limits would have cost in false alarms.",
    "example: plumbline archive report --table /srv/archive --from 2026-10-01 --to 2026-11-01 --html october.html",
    table_option(),
    option("--html", type=output_file, required=True, metavar="FILE", help="the page"),
    option(
        "--from",
        dest="begin",
        type=parsed_by(day),
        metavar="DAY",
        help=f"first day, UTC ({DEFAULT_DAYS} days before --to)",
    ),
    option("--to", dest="end", type=parsed_by(day), metavar="DAY", help="day after the last one, UTC (tomorrow)"),
    option("--limit", type=above_zero, default=5.0, metavar="DEG", help="angle above which a minute counts (5)"),
    option(
        "--shifts",
        type=parsed_by(_shifts),
        default=(),
        metavar="TIMES",
        help="when the shifts begin, such as 06:00,14:00,22:00",
    ),
    option("--zone", type=parsed_by(_zone), default="UTC", metavar="ZONE", help="time zone of hours and shifts (UTC)"),
    option(
        "--source",
        default="",
        metavar="SOURCE",
        help="where the recordings are, for the commands that open the worst swings",
    ),
    JSON_OPTION,
)
def run_report(arguments: argparse.Namespace) -> int:
    """Write the page."""
    require_extra("archive")
    require_plots()
    from gateway.archive.report import ReportQuestion, make_report
    from gateway.archive.report_page import render_archive_report
    from gateway.archive.tables import Archive
    from gateway.cli.output import show, write_text
    from gateway.errors import InputError

    now = datetime.now(UTC)
    end = arguments.end or now.replace(hour=0, minute=0, second=0, microsecond=0) + timedelta(days=1)
    begin = arguments.begin or end - timedelta(days=DEFAULT_DAYS)
    if begin >= end:
        raise InputError(f"--from {begin:%Y-%m-%d}: is not before --to {end:%Y-%m-%d}")
    question = ReportQuestion(begin, end, arguments.limit, arguments.zone, arguments.shifts)
    report = make_report(Archive(arguments.table), question, now)
    write_text(arguments.html, render_archive_report(report, arguments.source))
    show(f"{_sentence(report)}\nreport: {arguments.html}", _as_json(report), arguments.json)
    return 0


def _sentence(report: "ArchiveReport") -> str:
    above = [each for each in report.gateways if each.exceedances]
    total = sum(each.exceedances for each in above)
    return (
        f"{total} exceedances of {report.question.limit_deg:g} deg on {len(above)} of {len(report.gateways)} gateways"
    )


def _as_json(report: "ArchiveReport") -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "from_utc": report.question.begin.isoformat(),
        "to_utc": report.question.end.isoformat(),
        "limit_deg": report.question.limit_deg,
        "recordings": report.trust,
        "gateways": [asdict(each) for each in report.gateways],
        "minutes_by_hour": report.by_hour.tolist(),
        "worst": [asdict(each) | {"utc": each.utc.isoformat()} for each in report.worst],
        "unknown": [asdict(each) for each in report.unknown],
        "limits": [asdict(each) for each in report.limits],
        "types": {kind: asdict(each) for kind, each in report.types.items()},
        "proposals": [
            asdict(each) | {"next_utc": each.next_utc.isoformat(), "proposed_utc": each.proposed_utc.isoformat()}
            for each in report.proposals
        ],
    }
