"""`plumbline fleet deflection`: the deflection of a girder from two gateways, or from two recordings, at its ends."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from gateway.cli.argument_types import above_zero, operator, operator_option, whole_number
from gateway.cli.command import command, option
from gateway.cli.output import output_file
from gateway.cli.remote.remote_align import MAX_QUEUED_TILTS, TILT_SILENCE_S

if TYPE_CHECKING:
    from gateway.bench.deflection_history import DeflectionSeries, LiveDeflection
    from gateway.bench.girder_deflection import Deflection, Girder, InwardAxis
    from gateway.bus.client import GatewayClient
    from gateway.measurement.source import Source

KEY = "plumbline/"
"""Beginning of a gateway's key on the bus; anything else is a recording."""
INWARD_AXES = {sign + name: (index, 1 if sign == "+" else -1) for index, name in enumerate("xyz") for sign in "+-"}


@command(
    "deflection",
    "deflection of a crane girder at mid-span, from the sensors at its ends",
    "Print how far a girder on two supports sags at mid-span, from the rotations of its ends against a zero at "
    "the beginning (Zhu et al. 2020, eq. 25): live from two gateways, or from two recordings. Positive is downwards.",
    "examples: plumbline fleet deflection left.mcap right.mcap --half-span-m 0.8 --load-offset-m 0.065 --html d.html "
    "| plumbline fleet deflection plumbline/v1/yard/crane-1/west plumbline/v1/yard/crane-1/east --half-span-m 9.5",
    option("left", metavar="LEFT", help="recording (.mcap, folder, .csv) or gateway key of the left end"),
    option("right", metavar="RIGHT", help="the same of the right end"),
    option("--half-span-m", type=above_zero, required=True, metavar="M", help="half the distance of the supports"),
    option(
        "--load-offset-m",
        type=above_zero,
        default=0.0,
        metavar="M",
        help="distance of each of two equal loads, the wheels of a trolley, from mid-span (default: a single load)",
    ),
    option(
        "--u-mm", type=above_zero, default=1.0, metavar="MM", help="standard uncertainty of both lengths (default 1)"
    ),
    *(
        option(
            f"--{side}-axis",
            choices=tuple(INWARD_AXES),
            default=default,
            help=f"housing axis of the {side} sensor that points to mid-span (default {default}; write --{side}-axis=-x)",
        )
        for side, default in (("left", "+x"), ("right", "-x"))
    ),
    option(
        "--zero-s",
        type=above_zero,
        default=10.0,
        metavar="S",
        help="duration of the zero at the beginning, the girder unloaded (default 10)",
    ),
    operator_option("measures"),
    option("--json", type=output_file, metavar="FILE", help="recordings: also write the result as JSON; -: print it"),
    option("--csv", type=output_file, metavar="FILE", help="recordings: write the deflection over time"),
    option("--html", type=output_file, metavar="FILE", help="recordings: write a report with a figure"),
    option(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="gateways: address of the router, or twice: of the left and of the right gateway (default tcp/127.0.0.1:7447)",
    ),
    option("--count", type=whole_number, metavar="N", help="gateways: end after N deflections"),
)
def run_deflection(arguments: argparse.Namespace) -> int:
    """Print the deflection: live, or of recordings."""
    from gateway.bench.girder_deflection import Girder
    from gateway.errors import InputError

    if arguments.load_offset_m >= arguments.half_span_m:
        raise InputError("--load-offset-m must be below --half-span-m: the loads stand between the supports")
    u_m = arguments.u_mm / 1000
    girder = Girder(arguments.half_span_m, arguments.load_offset_m, u_m, u_m if arguments.load_offset_m > 0 else 0.0)
    axes = (INWARD_AXES[arguments.left_axis], INWARD_AXES[arguments.right_axis])
    live = [name.startswith(KEY) for name in (arguments.left, arguments.right)]
    if all(live):
        return _show_live(arguments, girder, axes)
    if any(live):
        raise InputError(f"{arguments.left} and {arguments.right}: give two recordings, or two keys of gateways")
    return _evaluate(arguments, girder, axes)


def _evaluate(arguments: argparse.Namespace, girder: "Girder", axes: "tuple[InwardAxis, InwardAxis]") -> int:
    from gateway.bench.deflection_history import deflection_series, render_deflection_report
    from gateway.certificate.traceability import LENGTHS_AND_RECORDS, measurement_facts
    from gateway.cli.output import show, write_text
    from gateway.measurement.source import read_source

    left, right = (read_source([Path(name)]) for name in (arguments.left, arguments.right))
    series = deflection_series(left, right, girder, axes, arguments.zero_s)
    warnings = list(series.most_turned.warnings)
    stated = measurement_facts(LENGTHS_AND_RECORDS, operator(arguments), _temperatures((left, right)))
    rows = [
        (float(time_s), one.deflection_m, one.u_m, one.left_rad, one.right_rad)
        for time_s, one in zip(series.time_s, series.deflections, strict=True)
    ]
    result = {
        "girder": {
            "half_span_m": girder.half_span_m,
            "load_offset_m": girder.load_offset_m,
            "factor_m": girder.factor_m,
        },
        "traceability": dict(stated),
        "zero_s": series.zero_s,
        "largest": {"deflection_m": series.largest.deflection_m, "u_m": series.largest.u_m},
        "columns": ["time_s", "deflection_m", "u_m", "left_rad", "right_rad"],
        "series": rows,
        "warnings": warnings,
    }
    if arguments.csv is not None:
        lines = [
            "time_s,deflection_m,u_m,left_rad,right_rad",
            *(",".join(f"{value:.9g}" for value in row) for row in rows),
        ]
        write_text(arguments.csv, "\n".join(lines) + "\n")
    if arguments.html is not None:
        text = f"half span {girder.half_span_m:g} m, loads {girder.load_offset_m:g} m off mid-span"
        deflection_mm, u_mm = ([1000 * row[column] for row in rows] for column in (1, 2))
        page = render_deflection_report(
            (left.name, right.name),
            text,
            stated,
            [row[0] for row in rows],
            deflection_mm,
            u_mm,
            [*warnings, *left.temperature_warnings, *right.temperature_warnings],
        )
        write_text(arguments.html, page)
    show(_summary(series, warnings), result, arguments.json)
    return 0


def _temperatures(sources: "Sequence[Source]") -> str:
    from numpy import concatenate, isfinite

    from gateway.certificate.traceability import NOT_RECORDED

    known = [source.recording.temperature_c for source in sources if source.recording.temperature_c is not None]
    found_c = concatenate([[], *known])
    found_c = found_c[isfinite(found_c)]
    return f"{found_c.min():.1f} to {found_c.max():.1f} °C" if len(found_c) else NOT_RECORDED


def _summary(series: "DeflectionSeries", warnings: Sequence[str]) -> str:
    return "\n".join(
        [
            f"{len(series.deflections)} averages of 1 s after a zero of {series.zero_s:g} s",
            f"largest: {format_deflection(series.largest)}",
            f"last:    {format_deflection(series.deflections[-1])}",
            *(f"warning: {text}" for text in warnings),
        ]
    )


def format_deflection(found: "Deflection") -> str:
    """Return a deflection with its expanded uncertainty and the rotations of the ends."""
    from math import degrees

    return (
        f"deflection {1000 * found.deflection_m:+.3f} +- {2000 * found.u_m:.3f} mm (k = 2), "
        f"ends {degrees(found.left_rad):+.4f} and {degrees(found.right_rad):+.4f} deg"
    )


def _show_live(arguments: argparse.Namespace, girder: "Girder", axes: "tuple[InwardAxis, InwardAxis]") -> int:
    from gateway.bench.deflection_history import LiveDeflection
    from gateway.bus.client import GatewayClient

    endpoints = arguments.connect or ["tcp/127.0.0.1:7447"]
    with (
        closing(GatewayClient(endpoints[0], arguments.left)) as left,
        closing(GatewayClient(endpoints[-1], arguments.right)) as right,
    ):
        u_relative = (_relative_u(left, axes[0][0]), _relative_u(right, axes[1][0]))
        live = LiveDeflection(girder, axes, u_relative, arguments.zero_s)
        return show_deflection((left, right), live, sys.stdout, arguments.count)


def _relative_u(client: "GatewayClient", inward: int) -> float:
    """Return the relative uncertainty of a gateway's relative angles, by the record that it has in force."""
    from gateway.bench.girder_deflection import relative_u_of_record
    from gateway.calibration.record import CalibrationRecord

    record = ((client.status() or {}).get("calibration") or {}).get("record") or None
    return relative_u_of_record(None if record is None else CalibrationRecord.model_validate(record), inward)


def show_deflection(
    clients: "tuple[GatewayClient, GatewayClient]", live: "LiveDeflection", out: TextIO, count: int | None = None
) -> int:
    """Show the deflection with each tilt until Ctrl-C, or `count` of them; wait while a link is lost."""
    from gateway.bench.deflection_history import Side
    from gateway.cli.output import StatusLine
    from gateway.daemon.runtime.worker import BoundedQueue
    from gateway.topics import adapter

    sides: tuple[Side, Side] = ("left", "right")
    tilts: BoundedQueue[tuple[Side, dict[str, Any]]] = BoundedQueue(MAX_QUEUED_TILTS)

    def subscribe(side: Side, client: "GatewayClient") -> None:
        client.subscribe("tilt", lambda tilt: tilts.put((side, tilt)))

    for side, client in zip(sides, clients, strict=True):
        subscribe(side, client)
    line, shown = StatusLine(out), 0
    while count is None or shown < count:
        if (item := tilts.get(TILT_SILENCE_S)) is None:
            text = "no tilts arrive; waiting for the gateways"
            line.update(text, text)
            for side, client in zip(sides, clients, strict=True):
                if client.reconnect():
                    subscribe(side, client)
            continue
        view = live.add(item[0], adapter("tilt").validate_python(item[1]))
        if view.deflection is None:
            line.update(view.text, view.text)
        else:
            shown += 1
            text = format_deflection(view.deflection) + "".join(f"; {text}" for text in view.deflection.warnings)
            line.update(text, text)
    return 0
