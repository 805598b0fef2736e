"""Reads recordings for a calibration: the project's CSV, or a table in counts, volts, m/s² or g from elsewhere."""

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np

from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from devices.recording import Recording
from devices.table import HEADER_LINES, TableLayout, read_table
from gateway.errors import InputError
from gateway.numerics.array import Array

Unit = Literal["g", "V", "counts", "m/s2"]
ColumnNames = tuple[str, str, str]
"""Names of the columns of the x, y and z axes."""

PROJECT_COLUMNS: ColumnNames = ("ax_g", "ay_g", "az_g")
AXIS_STEMS = (
    ("ax", "ay", "az"),
    ("acc_x", "acc_y", "acc_z"),
    ("accel_x", "accel_y", "accel_z"),
    ("x", "y", "z"),
    ("u_x", "u_y", "u_z"),
)
"""Column names of the axes without the suffix of their unit."""
UNIT_SUFFIXES: dict[str, Unit] = {
    "_g": "g",
    "_v": "V",
    "_counts": "counts",
    "_raw": "counts",
    "_m_s2": "m/s2",
    "_ms2": "m/s2",
}
TIME_COLUMNS = ("time_s", "t_s", "time", "t", "timestamp_s", "seconds")
TEMPERATURE_COLUMNS = ("temperature_c", "temp_c")
MIN_COUNTS = 50.0
"""Least magnitude of whole numbers that are counts."""
NORM_RANGE_G = (0.7, 1.3)
"""Range of the median magnitude of readings in g: an uncalibrated sensor at rest."""
NORM_RANGE_M_S2 = (8.0, 11.5)
"""Range of the median magnitude of readings in m/s²."""
NORM_RANGE_V = (0.2, 7.0)
"""Range of the median magnitude of readings in V: three outputs near the middle of a supply of at most 5 V."""


@dataclass(frozen=True, slots=True)
class FileReadings:
    """Readings of one file, in the unit of the record."""

    path: Path
    unit: Literal["g", "V", "counts"]
    time_s: Array
    raw: Array
    """Readings, shape (n, 3)."""
    temperature_c: Array | None
    """Temperatures, shape (n,), NaN for a row without one."""
    n_skipped: int
    """Number of rows that could not be used."""
    unit_is_stated: bool = False
    """Whether the file or the user states the unit; otherwise it is found from names or numbers."""
    units_per_g: float | None = None
    """Nominal sensitivity of the device; None: the file does not state it."""
    device_id: str | None = None
    """Identity of the device; None: the file does not state it."""


@dataclass(frozen=True, slots=True)
class TableOptions:
    """Options of the command line about the files."""

    unit: Unit | None = None
    columns: ColumnNames | None = None
    time: str | None = None
    rate_hz: float | None = None


def read_file(path: Path, options: TableOptions) -> FileReadings:
    """Read one file. Raises `RecordingError` or `InputError` with the file and the remedy."""
    header, axes = _find_header(path, options.columns)
    time = options.time or next((name for name in header if name.lower() in TIME_COLUMNS), None)
    if time is None and options.rate_hz is None:
        raise InputError(f"{path}: no time column ({', '.join(TIME_COLUMNS[:3])}); give --rate HZ, or --time COLUMN")
    layout = TableLayout(
        axes=axes,
        unit="g",  # no conversion by the table reader: the unit is determined below
        time=time,
        rate_hz=options.rate_hz if time is None or options.time is not None else None,
        temperature_c=next((name for name in header if name.lower() in TEMPERATURE_COLUMNS), None),
    )
    recording = read_table(path, layout)
    unit = options.unit or _unit_by_suffix(axes[0]) or _unit_by_size(path, recording.raw)
    return _file_readings(path, recording, unit, unit_is_stated=options.unit is not None)


def _find_header(path: Path, wanted: ColumnNames | None) -> tuple[list[str], ColumnNames]:
    """Return the header line's names and those of the axes; without a header, the table reader reports what is wrong."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            lines = list(islice(file, HEADER_LINES))
    except OSError:
        lines = []
    for line in lines:
        names = [name.strip().strip('"') for name in line.split(",")]
        axes = _find_axes(names) if wanted is None else wanted
        if axes is not None and set(axes) <= set(names):
            return names, axes
    read_table(path, TableLayout(axes=wanted or PROJECT_COLUMNS, unit="g", time="time_s"))
    return ["time_s"], wanted or PROJECT_COLUMNS


def _find_axes(names: list[str]) -> ColumnNames | None:
    by_lower = {name.lower(): name for name in names}
    for stems in AXIS_STEMS:
        for suffix in ("", *UNIT_SUFFIXES):
            wanted = [stem + suffix for stem in stems]
            if all(name in by_lower for name in wanted):
                x, y, z = (by_lower[name] for name in wanted)
                return x, y, z
    return None


def _unit_by_suffix(column: str) -> Unit | None:
    return next((unit for suffix, unit in UNIT_SUFFIXES.items() if column.lower().endswith(suffix)), None)


def _unit_by_size(path: Path, raw: Array) -> Unit:
    """Return the unit that the size of the numbers shows. Raises `InputError` if it is ambiguous."""
    norm = float(np.median(np.linalg.norm(raw, axis=1)))
    if np.all(raw == np.rint(raw)) and norm > MIN_COUNTS:
        return "counts"
    ranges: tuple[tuple[Unit, tuple[float, float]], ...] = (
        ("g", NORM_RANGE_G),
        ("m/s2", NORM_RANGE_M_S2),
        ("V", NORM_RANGE_V),
    )
    for unit, (low, high) in ranges:
        if low < norm < high:
            return unit
    raise InputError(f"{path}: in which unit are its readings (|m| about {norm:.3g})? give --unit counts, V, g or m/s2")


def _file_readings(path: Path, recording: Recording, unit: Unit, *, unit_is_stated: bool) -> FileReadings:
    raw = recording.raw / STANDARD_GRAVITY_M_S2 if unit == "m/s2" else recording.raw
    return FileReadings(
        path=path,
        unit="g" if unit == "m/s2" else unit,
        time_s=recording.time_s,
        raw=raw,
        temperature_c=recording.temperature_c,
        n_skipped=recording.invalid + recording.repeated + recording.backward + recording.truncated,
        unit_is_stated=unit_is_stated,
    )
