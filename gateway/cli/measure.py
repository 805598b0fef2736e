"""`plumbline measure`: offline evaluation of a recording."""

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path

from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION, output_file
from gateway.cli.recording_options import add_interval, add_table_options, interval, table_options

EXAMPLE = """examples:
  plumbline measure log.csv --rig rig.toml --json result.json
  plumbline measure plumbline-data/*.mcap --motion motion.csv
  plumbline measure plumbline-data --from 07:30:00 --to 07:35:00 --json -
  plumbline measure phone.csv --rig rig.toml --axes y,-x,z --from 20 --to 60"""


@command(
    "measure",
    "compute swing, tilt and conditions of a recording",
    "Compute swing, tilt and conditions of a recording: the estimate with its uncertainty, and the four "
    "published formulas; where the crane works, also what crane and load did when, with the largest angles. Several files of "
    "one gateway are one recording; an incomplete file is read up to its end.",
    EXAMPLE,
    option(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help=".mcap files of one gateway, a folder of them, or one table: time_s,ax_g,ay_g,az_g, or of another program",
    ),
    add_interval,
    option(
        "--rig",
        type=Path,
        metavar="RIG",
        help="rig.toml with housing position and rope length, which may be left out (default: those in the gateway's .mcap)",
    ),
    JSON_OPTION,
    option(
        "--motion",
        type=output_file,
        metavar="FILE.csv",
        help="write the motion at every 0.1 s: angle with uncertainty, pivot acceleration, hoist speed, rope length, state",
    ),
    partial(add_table_options, planar=True),
)
def run_measure(arguments: argparse.Namespace) -> int:
    """Measure a recording and print the result."""
    from gateway.cli.output import show, write_text
    from gateway.errors import InputError
    from gateway.measurement.measure import measure
    from gateway.measurement.motion import motion_table
    from gateway.measurement.report import as_json, as_text
    from gateway.measurement.rig_file import read_rig_of_recording
    from gateway.measurement.source import read_source

    part, options = interval(arguments), table_options(arguments)
    found = None if arguments.rig is None else read_rig_of_recording(arguments.rig, arguments.logs, part, options)
    source = read_source(arguments.logs, None if found is None else found.rig, part, options)
    if found is not None:
        source = replace(source, remarks=(*source.remarks, *found.remarks))
    result = measure(source, with_motion=arguments.motion is not None)
    if arguments.motion is not None:
        if result.motion is None:
            raise InputError(f"{source.name}: the motion is not known: {'; '.join(result.swing.reasons)}")
        write_text(arguments.motion, motion_table(result.motion.history))
    show(as_text(source, result), as_json(source, result), arguments.json)
    return 0
