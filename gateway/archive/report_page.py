"""The report of an archive as one self-contained page with figures. What rests on recordings that are not verified is marked."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FuncFormatter

from gateway.archive.alternatives import ReplayChange
from gateway.archive.report import DRIFT_LIMIT_DEG, MAX_WORST, ArchiveReport, GatewayMonth, WorstSwing
from gateway.calibration.drift.fleet_drift import TypeDrift
from gateway.certificate.bench_report import ReportTable, render_bench_report
from gateway.certificate.drift_report import SENSOR_HEADER, sensor_row
from gateway.documents.figures import AFTER, ALARM, BEFORE, Figure
from gateway.documents.format import UNKNOWN, format_fixed, format_percent
from gateway.documents.plots import add_legend, render_svg
from gateway.recording.reading.interval import iso_utc

HEIGHT_IN = 2.4
"""Height of a figure. Basis: a choice of taste; three fill a page."""
MAX_GATEWAYS = 200
"""Gateways that are listed, the worst first. Basis: a choice; a page of ten sheets."""
FEWEST_BARS, MOST_BARS = 10, 30
"""Room for bars. Basis: a choice of taste; a single bar is no wall, and thirty names do not touch."""
NOT_VERIFIED = " *"
MARK_NOTE = "* not verified: rests on recordings that no known key has signed as a whole"


def render_archive_report(report: ArchiveReport, source: str) -> str:
    """Return the page; `source` is the place of the recordings, for the commands that open them."""
    question = report.question
    shown = report.gateways[:MAX_GATEWAYS]
    trust = ", ".join(f"{count} {name}" for name, count in report.trust.items())
    return render_bench_report(
        "Swings of a fleet",
        facts=(
            ("From", f"{question.begin:%Y-%m-%d %H:%M} UTC"),
            ("To", f"{question.end:%Y-%m-%d %H:%M} UTC"),
            ("Limit", f"{question.limit_deg:g}°"),
            ("Gateways", str(len(report.gateways))),
            ("Recordings", trust),
        ),
        drawings=(_hours(report), _gateway_bars(shown), _limit_figure(report)),
        tables=[table for table in _tables(report, shown, source) if table.rows],
        warnings=_warnings(report),
    )


def _warnings(report: ArchiveReport) -> list[str]:
    doubtful = sum(count for trust, count in report.trust.items() if trust != "verified")
    found = (
        [f"{doubtful} recordings are not verified; rows that rest on them are marked{NOT_VERIFIED}"] if doubtful else []
    )
    if len(report.gateways) > MAX_GATEWAYS:
        found.append(f"{len(report.gateways) - MAX_GATEWAYS} gateways with less above the limit are not listed")
    return found + [f"calibration not judged: {text}" for text in report.not_judged]


def _tables(report: ArchiveReport, shown: Sequence[GatewayMonth], source: str) -> list[ReportTable]:
    limit = f"{report.question.limit_deg:g}°"
    return [
        ReportTable(
            f"Exceedances of {limit} by crane, and availability",
            ("gateway", "exceedances", "minutes above", "largest / °", "recorded", "of it known"),
            tuple(_gateway_row(report, each) for each in shown),
            f"An exceedance is a row of minutes above the limit. Recorded: share of the time of the report. {MARK_NOTE}.",
        ),
        ReportTable(
            f"Minutes above {limit} by shift",
            ("shift", "minutes"),
            tuple((name + _mark(verified), str(minutes)) for name, minutes, verified in report.by_shift),
            f"Times of {report.question.zone}.",
        ),
        ReportTable(
            "Worst swings",
            ("gateway", "time, UTC", "angle / °", "upper end / °", "opens it"),
            tuple(_worst_row(each, source) for each in report.worst),
            "The worst of each gateway and hour, with the upper end of its 95 % interval.",
        ),
        ReportTable(
            "Calibrations, the most urgent first",
            SENSOR_HEADER,
            tuple(map(sensor_row, report.sensors)),
        ),
        ReportTable(
            "How long a calibration holds, by type of sensor",
            ("type", "sensors", "days", "95 % interval"),
            tuple(
                (kind, str(each.sensors), format_fixed(each.days, 0), _interval(each))
                for kind, each in report.types.items()
            ),
            f"Until the error of one sensor in twenty reaches {DRIFT_LIMIT_DEG:g}°, learned from those calibrated twice.",
        ),
        ReportTable(
            "Proposals: calibrate earlier than the sensor's own records say",
            ("sensor", "type", "by its records", "proposed"),
            tuple(
                (each.device_id, each.kind, f"{each.next_utc:%Y-%m-%d}", f"{each.proposed_utc:%Y-%m-%d}")
                for each in report.proposals
            ),
            "By the lower end of the interval of its type. A proposal, which nothing applies by itself.",
        ),
        ReportTable(
            "Drift at rest, as the gateways say",
            ("gateway", "sensor", "state", "error of the norm / mg", "said at, UTC"),
            tuple(
                (
                    each.gateway + _mark(each.is_verified),
                    each.device_id,
                    each.state,
                    UNKNOWN if each.norm_error_mg is None else format_fixed(each.norm_error_mg, 1),
                    f"{each.utc:%Y-%m-%d %H:%M}",
                )
                for each in report.at_rest
            ),
        ),
        ReportTable(
            "Time in which the swing was not known",
            ("reason", "validity", "hours", "gateways"),
            tuple(
                (
                    each.reason + _mark(each.is_verified),
                    each.validity,
                    format_fixed(each.duration_s / 3600, 2),
                    str(each.gateways),
                )
                for each in report.unknown
            ),
            "Numbers in reasons are replaced by #.",
        ),
        ReportTable(
            "What another limit would have cost",
            ("limit / °", "alarms", "false alarms", "share"),
            tuple(
                (
                    format_fixed(each.limit_deg, 1),
                    str(each.alarms),
                    str(each.false_alarms),
                    format_percent(100 * each.false_alarms / each.alarms) if each.alarms else UNKNOWN,
                )
                for each in report.limits
            ),
            "By the rule of the alerts for the present angle, minute by minute: alarms less than a minute apart are one. "
            "False: the best estimate of the angle stayed below the limit. Alarms of coming peaks are not counted.",
        ),
        ReportTable(
            "What replays tell otherwise than was recorded",
            ("gateway", "start, UTC", "version, calibration", "missed", "added", "other level", "largest angle / °"),
            tuple(map(_replay_row, report.replays.changes[:MAX_WORST])),
            f"Of {report.replays.compared} replays in the table, the {MAX_WORST} in which an operator would have noticed most. "
            "Missed: alerts that were recorded and are not computed; added: the other way round; other level: a warning "
            "in place of a trip, or the other way round.",
        ),
    ]


def _gateway_row(report: ArchiveReport, each: GatewayMonth) -> tuple[str, ...]:
    whole_s = (report.question.end - report.question.begin).total_seconds()
    return (
        each.gateway + _mark(each.is_verified),
        str(each.exceedances),
        str(each.exceeded_minutes),
        UNKNOWN if each.largest_deg is None else format_fixed(each.largest_deg, 2),
        format_percent(100 * each.recorded_s / whole_s),
        format_percent(100 * each.known_s / each.recorded_s if each.recorded_s else None),
    )


def _worst_row(each: WorstSwing, source: str) -> tuple[str, ...]:
    return (
        each.gateway + _mark(each.is_verified),
        f"{each.utc:%Y-%m-%d %H:%M:%S}",
        format_fixed(each.angle_deg, 2),
        format_fixed(each.upper_deg, 2),
        incident_command(each, source),
    )


def _interval(drift: TypeDrift) -> str:
    return f"{format_fixed(drift.low_days, 0)} to {format_fixed(drift.high_days, 0)}"


def _replay_row(each: ReplayChange) -> tuple[str, ...]:
    change = each.change
    return (
        each.gateway + _mark(each.is_verified),
        f"{each.utc:%Y-%m-%d %H:%M:%S}",
        each.software + (f", {each.calibration}" if each.calibration else ""),
        *(str(len(alerts)) for alerts in (change.missed, change.added, change.other_level)),
        " to ".join(UNKNOWN if angle is None else format_fixed(angle, 2) for angle in change.angle_deg),
    )


def incident_command(each: WorstSwing, source: str) -> str:
    """Return the command that makes the report of a swing."""
    path = each.path if not source or "://" in source else str(Path(source) / each.path)
    around = iso_utc(round(each.utc.timestamp() * 1e9))
    return shlex.join(["plumbline", "record", "incident", path, "--around", around])


def _mark(is_verified: bool) -> str:
    return "" if is_verified else NOT_VERIFIED


def _hours(report: ArchiveReport) -> Figure:
    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        axes.bar(np.arange(24), report.by_hour, color=AFTER)
        axes.set_xlabel(f"hour of the day, {report.question.zone}")
        axes.set_ylabel("minutes")
        axes.set_xticks(range(0, 24, 2))
        canvas.subplots_adjust(bottom=0.2)

    limit = f"{report.question.limit_deg:g}°"
    svg = render_svg("hours", f"Minutes above {limit} by hour of the day", HEIGHT_IN, draw)
    return Figure(svg, f"Minutes above {limit} by hour of the day, all gateways.")


def _gateway_bars(shown: Sequence[GatewayMonth]) -> Figure:
    worst = [each for each in shown if each.exceeded_minutes][:MOST_BARS]

    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        axes.bar(np.arange(len(worst)), [each.exceeded_minutes for each in worst], color=AFTER)
        axes.set_ylabel("minutes")
        axes.set_xlim(-0.6, max(len(worst), FEWEST_BARS) - 0.4)
        names = [each.gateway.split("/")[1] for each in worst]
        axes.set_xticks(range(len(worst)), names, rotation=60, ha="right", rotation_mode="anchor")
        canvas.subplots_adjust(bottom=0.35)

    svg = render_svg("gateways", "Minutes above the limit by crane", HEIGHT_IN, draw)
    return Figure(svg, "Minutes above the limit by crane, the thirty worst.")


def _limit_figure(report: ArchiveReport) -> Figure:
    limits = [each.limit_deg for each in report.limits]

    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        axes.plot(limits, [each.alarms for each in report.limits], color=BEFORE, label="all alarms")
        axes.plot(
            limits, [each.false_alarms for each in report.limits], color=ALARM, linestyle="--", label="false alarms"
        )
        axes.set_yscale("symlog", linthresh=1)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_xlabel("limit / °")
        axes.set_ylabel("alarms")
        canvas.subplots_adjust(bottom=0.2)
        add_legend(canvas)

    return Figure(
        render_svg("limits", "Alarms and false alarms by limit", HEIGHT_IN, draw),
        "Alarms that a limit would have raised, and the false ones among them.",
    )
