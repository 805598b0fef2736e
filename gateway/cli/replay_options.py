"""The options of `plumbline run --replay`: a recording in place of the configured device."""

import argparse
from pathlib import Path
from typing import Any

from gateway.cli.argument_types import at_least_zero
from gateway.cli.table_options import add_table_options


def add_replay_options(command: argparse.ArgumentParser) -> None:
    """Add the recording, its speed, and the options of tables."""
    command.add_argument(
        "--replay", type=Path, metavar="LOG", help="play a recording in place of the device: .mcap, or a table"
    )
    command.add_argument(
        "--speed", type=at_least_zero, metavar="N", help="of --replay: multiple of real time; 0: as fast as possible"
    )
    add_table_options(command)


def replay_section(arguments: argparse.Namespace) -> dict[str, Any] | None:
    """Return the section `[device]` of the options; None without `--replay`. Raises `InputError` for options without it."""
    from gateway.errors import InputError

    stated = {
        "speed": arguments.speed,
        "axis_columns": None if arguments.columns is None else list(arguments.columns),
        "time_column": arguments.time,
        "unit": arguments.unit,
        "units_per_g": arguments.units_per_g,
        "rate_hz": arguments.rate,
        "axes_map": None
        if arguments.axes is None
        else ",".join(f"{'-' if sign < 0 else ''}{'xyz'[axis]}" for axis, sign in arguments.axes),
    }
    section = {key: value for key, value in stated.items() if value is not None}
    if arguments.replay is not None:
        return {"kind": "replay", "path": str(arguments.replay), **section}
    if section:
        raise InputError(
            "--columns, --unit, --units-per-g, --time, --axes, --rate and --speed describe the recording of --replay LOG"
        )
    return None
