"""The columns, the unit and the notation of a text table: what separates its columns, its decimal mark, where its rows begin."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from datetime import time as time_of_day
from io import TextIOWrapper
from pathlib import Path
from typing import Literal

from devices.block import RawUnit
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.regular_file import open_regular

Column = str | int
"""A column by its name in the header, or by its 1-based number where there is no header."""

TableUnit = Literal["g", "mg", "m/s2", "counts", "V"]
Delimiter = Literal[",", ";", "\t", " "]
"""A blank stands for any number of blanks and tabs."""
UNITS_PER_G: dict[TableUnit, float] = {"g": 1.0, "mg": 1000.0, "m/s2": STANDARD_GRAVITY_M_S2}
"""Units of specific force; readings in the other units have to be calibrated. Definition: units."""

BRACKETS = ("[", "(")
WITHOUT_BRACKETS = str.maketrans(";", ",", "[]()")
"""Lists within a row are separated by commas, whatever separates the lists."""
HEAD_LINES = 1000
"""Basis: a choice; enough to tell decimal comma, separator and columns."""
HEAD_CHARS = 1 << 20
"""Lines that are looked at. Basis: a choice; lines of a text are shorter, and a binary file is left soon."""
MIN_NUMBERS = 3
"""Fewest numbers in a row of readings. Definition: three axes."""
NOTATIONS: tuple[tuple[Delimiter, Literal[".", ","]], ...] = (
    (",", "."),
    ("\t", "."),
    (";", "."),
    ("\t", ","),
    (";", ","),
    (" ", "."),
    (" ", ","),
)
"""Delimiters with decimal marks, in the order of preference."""


@dataclass(frozen=True, slots=True)
class TableLayout:
    """The columns of a text table and their unit."""

    axes: tuple[Column, Column, Column]
    unit: RawUnit = "g"
    """Counts are whole numbers; any others are taken as they are."""
    time: Column | None = None
    """Time or sample counter; None: the rows are consecutive samples at `rate_hz`, which is then given."""
    rate_hz: float | None = None
    """Value of one second in the time column if that is not in seconds (a sample counter, milliseconds); the sample rate if
    there is no time column."""
    temperature_c: Column | None = None
    """Used if the file has it."""
    gyro_dps: tuple[Column, Column, Column] | None = None
    """Used if the file has all three."""
    gyro_scale: float = 1.0
    """Degrees per second in one unit of the gyroscope's columns."""
    delimiter: Delimiter = ","
    decimal: Literal[".", ","] = "."
    time_is_text: bool = False
    """The time column has dates with times (ISO 8601) or times of day in place of numbers."""


NATIVE = TableLayout(
    time="time_s",
    axes=("ax_g", "ay_g", "az_g"),
    temperature_c="temperature_c",
    gyro_dps=("gx_dps", "gy_dps", "gz_dps"),
)
"""`time_s,ax_g,ay_g,az_g[,temperature_c][,gx_dps,gy_dps,gz_dps]`."""


def required_columns(layout: TableLayout) -> tuple[Column, ...]:
    """Return the columns that must have a number in every row: time and axes."""
    return layout.axes if layout.time is None else (layout.time, *layout.axes)


def plain_row(line: str) -> str:
    """Return a row of lists in brackets, such as `[1, 2, 3]; 4`, as one list, and any other line as it is."""
    return line.translate(WITHOUT_BRACKETS) if line.lstrip().startswith(BRACKETS) else line


def split_line(line: str, layout: TableLayout) -> list[str]:
    """Return the entries of a line, without quotation marks, and with a point as the decimal mark."""
    if '"' in line:
        line = line.replace('"', "")
    if layout.decimal == ",":
        line = line.replace(",", ".")
    return line.split() if layout.delimiter == " " else [entry.strip() for entry in line.split(layout.delimiter)]


def seconds_of(text: str) -> float:
    """Return the seconds of a date with time (since 1970) or of a time of day. Raises `ValueError`."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        of_day = time_of_day.fromisoformat(text)
        moment = datetime.combine(datetime(1970, 1, 1, tzinfo=UTC), of_day)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


@dataclass(frozen=True, slots=True)
class TableHead:
    """The begin of a table."""

    delimiter: Delimiter
    decimal: Literal[".", ","]
    headers: tuple[tuple[str, ...], ...]
    """Lines above the first row that have as many entries as it; the nearest first."""
    rows: tuple[tuple[str, ...], ...]
    """Rows with at least three numbers and as many entries as the first of them."""

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.rows[0]) if self.rows else 0


def read_head(path: Path) -> TableHead:
    """Return the begin of a table. A file that cannot be read has no rows."""
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8-sig", errors="replace") as file:
            head = file.read(HEAD_CHARS).split("\n", HEAD_LINES)
        lines = [plain_row(line) for line in head[:HEAD_LINES] if line.strip()]
    except OSError:
        lines = []
    return max((_head(lines, *notation) for notation in NOTATIONS), key=_count_numbers)


def _head(lines: Sequence[str], delimiter: Delimiter, decimal: Literal[".", ","]) -> TableHead:
    layout = TableLayout(axes=(1, 2, 3), delimiter=delimiter, decimal=decimal)
    split = [tuple(split_line(line, layout)) for line in lines]
    first = next((place for place, entries in enumerate(split) if _numbers(entries) >= MIN_NUMBERS), None)
    if first is None:
        return TableHead(delimiter, decimal, (), ())
    width = len(split[first])
    rows = tuple(entries for entries in split[first:] if len(entries) == width and _numbers(entries) >= MIN_NUMBERS)
    headers = tuple(entries for entries in reversed(split[:first]) if len(entries) == width)
    return TableHead(delimiter, decimal, headers, rows)


def _count_numbers(head: TableHead) -> int:
    return sum(_numbers(entries) for entries in head.rows)


def _numbers(entries: Sequence[str]) -> int:
    return sum(is_number(entry) for entry in entries)


def is_number(text: str) -> bool:
    """Return whether an entry is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
