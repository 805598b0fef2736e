"""`plumbline calibrate`: offline calibration from recordings."""

import argparse
import getpass
import sys
from datetime import UTC, datetime
from pathlib import Path

from gateway.calibration.pose_method import PoseMethod
from gateway.cli.argument_types import above_zero

UNIDENTIFIED = "unidentified"


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "calibrate",
        help="make a calibration record from recordings",
        description="Finds the resting poses in recordings and makes a calibration record, with the code of a live session.",
        epilog="example: plumbline calibrate six-position faces.csv --device-id adxl355-1d-0042 --json record.json",
    )
    methods = command.add_subparsers(dest="method", metavar="METHOD", required=True)
    _add_six_position(methods)
    _add_norm_fit(methods)


def _add_six_position(methods: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    method = methods.add_parser(
        PoseMethod.SIX_POSITION.value,
        help="six faces up in turn, on a levelled surface, in any order",
        description="Determines offset, scale factor and misalignment from the six faces, in any order. Repeats are averaged.",
        epilog="example: plumbline calibrate six-position faces.csv --device-id part-7 --json record.json",
    )
    _add_common(method)
    method.add_argument(
        "--placement-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the faces' placement: level of the surface, squareness of the housing (default 0.1)",
    )


def _add_norm_fit(methods: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    method = methods.add_parser(
        PoseMethod.NORM_FIT.value,
        help="nine or more poses in all directions; no levelled surface needed",
        description="Determines offset, scale factor and non-orthogonality from |m| = 1 g in nine or more attitudes in all "
        "directions. Twelve are better, because the additional poses check the fit.",
        epilog="example: plumbline calibrate norm-fit session.csv --unit counts --rate 100 --json record.json",
    )
    _add_common(method)
    method.add_argument(
        "--frame-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the attitude of the sensor's axes in the housing, which this method does not measure "
        "(default 0.58)",
    )


def _add_common(method: argparse.ArgumentParser) -> None:
    method.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="CSV recordings: one of a whole session, or one per pose"
    )
    method.add_argument("--json", type=Path, metavar="FILE", help="write the record to FILE")
    method.add_argument(
        "--html", type=Path, metavar="FILE", help="write the certificate to FILE; it prints on one sheet of A4"
    )
    method.add_argument(
        "--device-id",
        default=UNIDENTIFIED,
        metavar="ID",
        help="identity of the sensor; the record is valid for no other sensor",
    )
    method.add_argument("--by", metavar="NAME", help="person who calibrates (default: the current user)")
    method.add_argument(
        "--parent",
        type=Path,
        metavar="FILE",
        help="the record in force: the change since then is judged, and a norm fit keeps its frame",
    )
    method.add_argument(
        "--unit",
        choices=("counts", "V", "g", "m/s2"),
        help="unit of the readings (default: by column name or size)",
    )
    method.add_argument(
        "--units-per-g",
        type=above_zero,
        metavar="N",
        help="nominal sensitivity (default: estimated from the readings)",
    )
    method.add_argument(
        "--columns", type=_columns, metavar="X,Y,Z", help="columns of the axes (default: found by their names)"
    )
    method.add_argument(
        "--time", metavar="COLUMN", help="column of the time in s, or, together with --rate, of a sample counter"
    )
    method.add_argument("--rate", type=above_zero, metavar="HZ", help="sample rate if there is no time column")
    method.set_defaults(run=run, placement_deg=None, frame_deg=None)


def run(arguments: argparse.Namespace) -> int:
    """Calibrate and print the result; 1 if the readings do not determine it or the record is not acceptable."""
    from gateway import __version__
    from gateway.calibration.acceptance import judge
    from gateway.calibration.offline.calibrate_files import CalibrateOptions, calibrate_files
    from gateway.calibration.offline.parent_record import read_parent
    from gateway.calibration.offline.readings_file import TableOptions
    from gateway.calibration.offline.report import format_report
    from gateway.calibration.record import NotDeterminedError
    from gateway.calibration.record_factory import make_record
    from gateway.certificate.page import render_certificate
    from gateway.cli.output import write_json, write_text

    parent = None if arguments.parent is None else read_parent(arguments.parent, arguments.device_id)
    tables = TableOptions(arguments.unit, arguments.columns, arguments.time, arguments.rate)
    stated = {"placement_u_deg": arguments.placement_deg, "frame_u_deg": arguments.frame_deg}
    known = {name: value for name, value in stated.items() if value is not None}
    options = CalibrateOptions(arguments.method, arguments.units_per_g, parent=parent, **known)
    try:
        found = calibrate_files(arguments.files, tables, options)
    except NotDeterminedError as error:
        print(f"plumbline calibrate: {error}", file=sys.stderr)
        return 1
    record = make_record(
        found.fit,
        device_id=arguments.device_id,
        unit=found.unit,
        software=__version__,
        by=arguments.by or _user(),
        created_utc=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        parent=None if parent is None else parent.id,
    )
    acceptance = judge(found.fit, parent)
    if arguments.json is not None:
        write_json(arguments.json, record.model_dump(mode="json"))
    if arguments.html is not None:
        write_text(arguments.html, render_certificate(record, parent))
    print(format_report(record, acceptance, found.notes + _identity_note(arguments.device_id)))
    return 1 if acceptance.refused else 0


def _identity_note(device_id: str) -> tuple[str, ...]:
    return ("no --device-id: the record cannot be put in force for any sensor",) if device_id == UNIDENTIFIED else ()


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown"


def _columns(text: str) -> tuple[str, str, str]:
    names = [name.strip() for name in text.split(",")]
    if len(names) != 3 or not all(names):
        raise argparse.ArgumentTypeError(f"{text} is not three column names X,Y,Z")
    return names[0], names[1], names[2]
