"""The columns, the unit and the notation of a text table."""

from dataclasses import dataclass
from datetime import UTC, datetime
from datetime import time as time_of_day
from pathlib import Path
from typing import Literal

import numpy as np

from devices.errors import RecordingError
from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2

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


@dataclass(frozen=True, slots=True)
class TableLayout:
    """The columns of a text table and their unit."""

    axes: tuple[Column, Column, Column]
    unit: TableUnit | None = None
    """Unit of the axis columns; without it a recording is refused."""
    time: Column | None = None
    """Time or sample counter; None: the rows are consecutive samples at `rate_hz`."""
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
    units_per_g: float | None = None
    """Nominal sensitivity of counts."""
    housing_frame: bool = False
    """The readings are calibrated specific force in the housing frame."""


NATIVE = TableLayout(
    time="time_s",
    axes=("ax_g", "ay_g", "az_g"),
    unit="g",
    temperature_c="temperature_c",
    gyro_dps=("gx_dps", "gy_dps", "gz_dps"),
    housing_frame=True,
)
"""`time_s,ax_g,ay_g,az_g[,temperature_c][,gx_dps,gy_dps,gz_dps]`."""


def check_layout(path: Path, layout: TableLayout) -> None:
    """Raise `RecordingError` for a layout that describes no table."""
    if layout.unit is None:
        raise RecordingError(f'{path}: the unit of its axis columns is not given; say "g", "m/s2" or "counts"')
    if layout.rate_hz is None and layout.time is None:
        raise RecordingError(f"{path}: neither a time column nor a sample rate is given; name one of them")
    if layout.rate_hz is not None and not 0 < layout.rate_hz < np.inf:
        raise RecordingError(f"{path}: a rate of {layout.rate_hz} Hz is impossible; give one above 0")
    needed = required_columns(layout)
    if len({type(column) for column in needed}) > 1:
        raise RecordingError(f"{path}: columns are given by name and by number; use one or the other")
    if any(isinstance(column, int) and column < 1 for column in needed):
        raise RecordingError(f"{path}: a column number below 1 is given; the first column is number 1")


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
