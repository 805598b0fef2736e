"""`plumbline measure`: offline evaluation of a recording."""

import argparse
from pathlib import Path


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "measure",
        help="compute swing, tilt and conditions of a recording",
        description="Compute swing, tilt and conditions of a recording: the estimate with its uncertainty, and the four "
        "published formulas.",
        epilog="example: plumbline measure log.csv --rig rig.toml --json result.json",
    )
    command.add_argument("log", type=Path, metavar="LOG", help=".mcap of the gateway, or .csv: time_s,ax_g,ay_g,az_g")
    command.add_argument(
        "--rig",
        type=Path,
        metavar="RIG",
        help="rig.toml with rope length and housing position (default: those in the gateway's .mcap)",
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="also write the result as JSON")
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Measure a recording and print the result."""
    from gateway.cli.output import write_json
    from gateway.measurement.measure import measure
    from gateway.measurement.report import as_json, as_text
    from gateway.measurement.rig import read_rig
    from gateway.measurement.source import read_source

    source = read_source(arguments.log, None if arguments.rig is None else read_rig(arguments.rig))
    result = measure(source)
    if arguments.json is not None:
        write_json(arguments.json, as_json(source, result))
    print(as_text(source, result))
    return 0
