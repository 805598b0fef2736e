"""The options of commands on recordings: which, in which interval and time zone, how tables are to be read, and who vouches.

Tables are the recordings of other programs, with columns, unit, time, axes and rate. The site's CA vouches for the keys of
gateways.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero, duration_s, parsed_by, recording_time
from gateway.cli.command import option
from gateway.extras import require_extra

if TYPE_CHECKING:
    from devices.axes_map import AxesMap
    from devices.tables.foreign import TableOptions
    from gateway.bus.known_gateways import RefuseKey
    from gateway.recording.reading.interval import RecordingInterval, RecordingTime


def add_interval(command: argparse.ArgumentParser) -> None:
    """Add the options of the interval."""
    begin = command.add_mutually_exclusive_group()
    begin.add_argument(
        "--from",
        dest="from_time",
        type=recording_time,
        metavar="T",
        help="begin here: seconds from the start of the recording (30, 1:30), or UTC (2026-11-22T07:30:00Z, or 07:30:05 on "
        "the day of the first sample)",
    )
    command.add_argument(
        "--to", dest="to_time", type=recording_time, metavar="T", help="end before this time, in the same forms"
    )
    begin.add_argument(
        "--last",
        dest="last_s",
        type=duration_s,
        metavar="D",
        help="only the end of the recording, or of what is before --to: seconds (90), minutes (1:30) or hours (1:00:00)",
    )


LOCAL_OPTION = option(
    "--local",
    action="store_true",
    help="print times in this computer's time zone in place of UTC, and read those of --from and --to so",
)
"""Times of this computer's time zone."""


def interval(arguments: argparse.Namespace) -> "RecordingInterval":
    """Return the interval of the options; without them the whole recording."""
    from gateway.recording.reading.interval import RecordingInterval

    is_local = getattr(arguments, "local", False)
    begin, end = (in_zone(time, is_local) for time in (arguments.from_time, arguments.to_time))
    return RecordingInterval(begin, end, last_s=arguments.last_s)


def in_zone(time: "RecordingTime | None", is_local: bool) -> "RecordingTime | None":
    """Return a time of the options, read in this computer's time zone with `--local`."""
    from gateway.recording.reading.interval import parse_recording_time

    return None if time is None else parse_recording_time(time.text, is_local=is_local)


PATHS_OPTION = option(
    "paths", type=Path, nargs="+", metavar="PATH", help=".mcap files written by the gateway, and folders of them"
)
"""The recordings, as `paths`."""
SELECTION_OPTIONS = (
    PATHS_OPTION,
    add_interval,
    LOCAL_OPTION,
)
"""The recordings and the interval of them, which `interval` returns."""


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
        type=parsed_by(_axes),
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

    return parse_axes_map(text)


CA_OPTION = option(
    "--ca",
    type=Path,
    metavar="FILE",
    help="ca.pem of the site: its CA must vouch today for the key, by the certificate of the gateway in the recordings; a "
    "revoked.pem beside it counts",
)
"""The CA that vouches for the keys of gateways."""


def refusal_by(ca: Path) -> "RefuseKey":
    """Return what says why a CA does not vouch for a key. Raises `InputError` where the file has none."""
    require_extra("security")
    from gateway.authorization.certificates import SiteAuthority
    from gateway.errors import InputError
    from gateway.pki.inspect import CertificateError, parse_authorities

    try:
        parse_authorities(ca.read_bytes())
    except (OSError, CertificateError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"--ca {ca}: {reason}; give the ca.pem that plumbline keys has made") from error
    return SiteAuthority(ca, ca.with_name("revoked.pem")).refuse
