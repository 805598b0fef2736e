"""The options that describe a recording of another program: columns, unit, time, axes and rate."""

import argparse
from typing import TYPE_CHECKING

from gateway.cli.options.argument_types import above_zero

if TYPE_CHECKING:
    from devices.axes_map import AxesMap
    from devices.tables.foreign import TableOptions

EXAMPLE = "--columns accX,accY,accZ --unit m/s2 --time timestamp:ms --axes y,-x,z"


def add_table_options(command: argparse.ArgumentParser, *, planar: bool = False) -> None:
    """Add the options of tables; `planar`: two axes may be stated."""
    table = command.add_argument_group(
        "recordings of other programs",
        "Text tables (CSV, TSV, blanks between columns; phyphox, Sensor Logger, WitMotion) and MATLAB files. What is not given "
        "is found by the names in the header and by the size of the numbers, and printed.",
    )
    table.add_argument(
        "--columns",
        type=_columns_or_plane if planar else _columns,
        metavar="X,Y,Z",
        help="names, or numbers from 1, of the columns of the axes"
        + ("; X,Z of a sensor that records the plane of its swing alone" if planar else ""),
    )
    table.add_argument(
        "--unit", choices=("g", "mg", "m/s2", "counts", "V"), help="unit of the axes; counts and V need a calibration"
    )
    table.add_argument(
        "--units-per-g", type=above_zero, metavar="N", help="nominal sensitivity of readings in counts or V"
    )
    table.add_argument(
        "--time",
        metavar="COLUMN",
        help="column of the time: seconds, NAME:ms (us, ns, hms for HHMMSS), date with time, or, beside --rate, sample counter",
    )
    table.add_argument(
        "--axes",
        type=_axes,
        metavar="MAP",
        help="axes of the file that are x, y and z (on a hanging housing +z points up), such as '-y,x,z'",
    )
    table.add_argument("--rate", type=above_zero, metavar="HZ", help="sample rate of rows without a time")


def table_options(arguments: argparse.Namespace) -> "TableOptions":
    """Return the options of the tables."""
    from devices.axes_map import SAME_AXES
    from devices.tables.foreign import TableOptions

    return TableOptions(
        unit=arguments.unit,
        columns=arguments.columns,
        time=arguments.time,
        rate_hz=arguments.rate,
        units_per_g=arguments.units_per_g,
        axes=arguments.axes or SAME_AXES,
    )


def _columns(text: str) -> tuple[str, str, str]:
    names = [name.strip() for name in text.split(",")]
    if len(names) != 3 or not all(names):
        raise argparse.ArgumentTypeError(f"{text} is not three columns X,Y,Z")
    return names[0], names[1], names[2]


def _columns_or_plane(text: str) -> tuple[str, ...]:
    names = [name.strip() for name in text.split(",")]
    if len(names) == 1:
        raise argparse.ArgumentTypeError(
            f"{text} is one axis, which shows no angle without the one along the rope; record X,Y,Z, or X,Z of a plane"
        )
    return (names[0], names[1]) if len(names) == 2 and all(names) else _columns(text)


def _axes(text: str) -> "AxesMap":
    from devices.axes_map import parse_axes_map

    try:
        return parse_axes_map(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
