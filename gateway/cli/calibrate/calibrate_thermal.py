"""`plumbline calibrate thermal`: offset and sensitivity against temperature, from ramps on the six faces."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero
from gateway.cli.calibrate.calibrate_record import (
    RECORD_OPTIONS,
    finish_record,
    read_parent_record,
    use_recorded_device,
)
from gateway.cli.command import command, option
from gateway.cli.recording_options import add_table_options, table_options

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gateway.bench.thermal.ramp_calibration import DatasheetLimits
    from gateway.calibration.input_files import FileReadings
    from gateway.calibration.record import CalibrationRecord


@command(
    "thermal",
    "temperature ramps, one on each of the six faces",
    "Determine offset and sensitivity of each axis against temperature, with 95 % intervals, from one ramp "
    "of temperature per face, in any order (Sawicki and Walendziuk 2016). A table needs the column temperature_c. The record "
    "has a thermal model, which the gateway applies inside the measured range. Exit code 1: an axis exceeds a limit.",
    "example: plumbline calibrate thermal ramps/*.csv --part ADXL335 --device-id part-7 --json record.json",
    option(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="recordings of one ramp each: .csv, or .mcap of the gateway; the sensor rests on one face throughout",
    ),
    *RECORD_OPTIONS,
    add_table_options,
    option(
        "--reference-c",
        type=float,
        metavar="C",
        help="temperature to which offset and matrix of the record refer (default: 25, or the middle of the ramps)",
    ),
    option(
        "--part", type=str.upper, metavar="NAME", help="part whose data sheet has the limits: ADXL335, ADXL355, ..."
    ),
    option("--limit-offset", type=above_zero, metavar="MG", help="largest change of the zero-g offset, mg/°C"),
    option("--limit-sensitivity", type=above_zero, metavar="PERCENT", help="largest change of the sensitivity, %%/°C"),
    option(
        "--at-rest",
        action="store_true",
        help="learn the axis along the rope from recordings of service, at rest, for the record of --parent; nothing "
        "uses the "
        "new record until it is put in force",
    ),
)
def run_thermal(arguments: argparse.Namespace) -> int:
    """Calibrate against temperature; return 1 where an axis exceeds a limit or the record is not acceptable."""
    from gateway.bench.thermal.output import format_thermal, thermal_figure
    from gateway.bench.thermal.ramp_calibration import calibrate_ramps
    from gateway.cli.progress import Progress
    from gateway.measurement.recording_files import read_calibration_readings

    limits = _limits(arguments)
    options = table_options(arguments)
    files = []
    with Progress() as progress:
        # one file is one attitude: segments of one gateway are not joined
        for number, path in enumerate(arguments.files, start=1):
            progress.tick(f"reading file {number} of {len(arguments.files)}")
            files += read_calibration_readings([path], options)
    use_recorded_device(arguments, files)
    parent = read_parent_record(arguments)
    if arguments.at_rest:
        return _learn_at_rest(arguments, files, parent)
    found = calibrate_ramps(files, units_per_g=arguments.units_per_g, reference_c=arguments.reference_c, limits=limits)
    figure = {"figure": thermal_figure(found).model_dump(mode="json")}
    code = finish_record(arguments, found.fit, found.unit, (), parent, figure)
    print()
    print(format_thermal(found.summary, None if limits is None else limits.part, found.range_c, found.unit))
    return 1 if any(axis.verdict == "exceeds" for axis in found.summary) else code


def _learn_at_rest(
    arguments: argparse.Namespace, files: "Sequence[FileReadings]", parent: "CalibrationRecord | None"
) -> int:
    from gateway.bench.thermal.rest_calibration import learn_at_rest
    from gateway.errors import InputError

    if parent is None:
        raise InputError("--at-rest needs --parent FILE: the record that was in force while the recordings were made")
    fit, found = learn_at_rest(files, parent)
    note = f"{found.rests} rests, {found.range_c[0]:.1f} to {found.range_c[1]:.1f} °C"
    return finish_record(arguments, fit, parent.unit, (note, "an offer: review it, then put it in force"), parent)


def _limits(arguments: argparse.Namespace) -> "DatasheetLimits | None":
    """Return the limits of `--part`, replaced by those given; None without any."""
    from dataclasses import replace

    from gateway.bench.thermal.ramp_calibration import LIMITS_BY_PART, DatasheetLimits
    from gateway.errors import InputError

    if arguments.part is not None and arguments.part not in LIMITS_BY_PART:
        raise InputError(
            f"--part {arguments.part} is not known ({', '.join(LIMITS_BY_PART)}); give --limit-offset MG instead"
        )
    offset, sensitivity = arguments.limit_offset, arguments.limit_sensitivity
    if arguments.part is None:
        return None if offset is None and sensitivity is None else DatasheetLimits("the options", offset, sensitivity)
    limits = LIMITS_BY_PART[arguments.part]
    return replace(
        limits,
        offset_mg_per_c=limits.offset_mg_per_c if offset is None else offset,
        sensitivity_percent_per_c=limits.sensitivity_percent_per_c if sensitivity is None else sensitivity,
    )
