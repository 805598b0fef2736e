"""What every calibration method has in common on the command line: the arguments of its record, and the files it writes."""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.argument_types import operator, operator_option
from gateway.cli.command import option
from gateway.cli.output import output_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gateway.calibration.calibration_fit import CalibrationFit
    from gateway.calibration.input_files import FileReadings
    from gateway.calibration.record import CalibrationRecord

UNIDENTIFIED = "unidentified"


def new_record(text: str) -> Path:
    """Parse the name of a calibration record to write: one that exists is never changed."""
    path = output_file(text)
    if path.is_file():
        raise argparse.ArgumentTypeError(f"{text}: exists, and a record is never changed; choose another name")
    return path


RECORD_OPTIONS = (
    option(
        "--json", type=new_record, metavar="FILE", help="write the record to FILE; -: print it in place of the report"
    ),
    option(
        "--html", type=output_file, metavar="FILE", help="write the certificate to FILE; it prints on one sheet of A4"
    ),
    option(
        "--dcc",
        type=output_file,
        metavar="FILE",
        help="write the certificate to FILE as a digital calibration certificate: XML by PTB's schema",
    ),
    option(
        "--device-id",
        default=UNIDENTIFIED,
        metavar="ID",
        help="identity of the sensor (default: the one in an .mcap); the record is valid for no other sensor",
    ),
    operator_option("calibrates"),
    option(
        "--parent",
        type=Path,
        metavar="FILE",
        help="the record in force: the change since then is judged, and a norm fit keeps its frame",
    ),
)
"""Where the record goes, whose it is, who made it, and its parent."""


def use_recorded_device(arguments: argparse.Namespace, files: "Sequence[FileReadings]") -> None:
    """Take the device's identity from the recordings where they state it.

    Raises `InputError` where they state several, or another one than `--device-id`.
    """
    from gateway.errors import InputError

    stated = {file.device_id for file in files if file.device_id is not None}
    if arguments.device_id != UNIDENTIFIED:
        stated.add(arguments.device_id)
    if len(stated) > 1:
        raise InputError(
            f"{files[-1].path}: recordings and --device-id name {' and '.join(sorted(stated))}; give one device"
        )
    arguments.device_id = stated.pop() if stated else UNIDENTIFIED


def read_parent_record(arguments: argparse.Namespace) -> "CalibrationRecord | None":
    """Return the record of `--parent`, None without it. Raises `InputError` for a file that is no record of this device."""
    from gateway.calibration.input_files import read_parent

    return None if arguments.parent is None else read_parent(arguments.parent, arguments.device_id)


def finish_record(
    arguments: argparse.Namespace,
    fit: "CalibrationFit",
    unit: str,
    notes: tuple[str, ...],
    parent: "CalibrationRecord | None",
    extra: "dict[str, Any] | None" = None,
    preface: str = "",
) -> int:
    """Make the record of a fit, write its files and print the report; 1 if the record is not acceptable.

    `extra` are further fields of the record, such as its figure; `preface` is printed before the report.
    """
    from gateway.calibration.acceptance import judge
    from gateway.calibration.calibrate_files import format_report
    from gateway.cli.output import show

    record = write_record(arguments, fit, unit, parent, extra)
    acceptance = judge(fit, parent)
    show(
        preface + format_report(record, acceptance, notes + identity_note(arguments.device_id)),
        record.model_dump(mode="json"),
        arguments.json,
    )
    return 1 if acceptance.refused else 0


def write_record(
    arguments: argparse.Namespace,
    fit: "CalibrationFit",
    unit: str,
    parent: "CalibrationRecord | None",
    extra: "dict[str, Any] | None" = None,
) -> "CalibrationRecord":
    """Make the record of a fit and write its certificate; `extra` are further fields of the record."""
    from gateway import __version__
    from gateway.calibration.acceptance import make_record
    from gateway.certificate.digital_certificate import render_digital_certificate
    from gateway.certificate.page import render_certificate
    from gateway.cli.output import write_text

    record = make_record(
        fit,
        device_id=arguments.device_id,
        unit=unit,
        software=__version__,
        by=operator(arguments),
        created_utc=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        parent=None if parent is None else parent.id,
        **(extra or {}),
    )
    if arguments.html is not None:
        write_text(arguments.html, render_certificate(record, parent))
    if arguments.dcc is not None:
        write_text(arguments.dcc, render_digital_certificate(record))
    return record


def identity_note(device_id: str) -> tuple[str, ...]:
    """Return a note where the sensor has no identity."""
    return ("no --device-id: the record cannot be put in force for any sensor",) if device_id == UNIDENTIFIED else ()
