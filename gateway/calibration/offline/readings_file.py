"""Recordings of a calibration as they come: the project's CSV, or a foreign table of counts, volts, m/s2 or g."""

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from devices.recording import Recording
from devices.table import HEADER_LINES, TableLayout, read_table
from gateway.errors import InputError

Unit = Literal["g", "V", "counts", "m/s2"]
Floats = NDArray[np.float64]
Axes = tuple[str, str, str]

OWN_AXES: Axes = ("ax_g", "ay_g", "az_g")
AXIS_STEMS = (
    ("ax", "ay", "az"),
    ("acc_x", "acc_y", "acc_z"),
    ("accel_x", "accel_y", "accel_z"),
    ("x", "y", "z"),
    ("u_x", "u_y", "u_z"),
)
UNIT_SUFFIXES: dict[str, Unit] = {
    "_g": "g",
    "_v": "V",
    "_counts": "counts",
    "_raw": "counts",
    "_m_s2": "m/s2",
    "_ms2": "m/s2",
}
TIME_NAMES = ("time_s", "t_s", "time", "t", "timestamp_s", "seconds")
TEMPERATURE_NAMES = ("temperature_c", "temp_c")
LARGEST_V = 7.0
"""Norm of three outputs in the middle of a supply of 5 V, less than half of it away."""


@dataclass(frozen=True, slots=True)
class Session:
    """One file's readings, in the record's unit."""

    path: Path
    unit: Literal["g", "V", "counts"]
    time_s: Floats
    raw: Floats
    """Shape (n, 3)."""
    temperature_c: Floats | None
    """Shape (n,), NaN where a row has none."""
    left_out: int
    """Rows that could not be used."""


@dataclass(frozen=True, slots=True)
class TableOptions:
    """What the command line says of the files."""

    unit: Unit | None = None
    columns: Axes | None = None
    time: str | None = None
    rate_hz: float | None = None


def read_session(path: Path, options: TableOptions) -> Session:
    """Read one file. Raises `RecordingError` or `InputError` naming the file and the mend."""
    header, axes = _find_header(path, options.columns)
    time = options.time or next((name for name in header if name.lower() in TIME_NAMES), None)
    if time is None and options.rate_hz is None:
        raise InputError(f"{path}: no time column ({', '.join(TIME_NAMES[:3])}); give --rate HZ, or --time COLUMN")
    layout = TableLayout(
        axes=axes,
        unit="g",  # as they stand; what they are is settled here
        time=time,
        rate_hz=options.rate_hz if time is None or options.time is not None else None,
        temperature_c=next((name for name in header if name.lower() in TEMPERATURE_NAMES), None),
    )
    recording = read_table(path, layout)
    return _session(path, recording, options.unit or _unit_of(axes[0]) or _guessed_unit(path, recording.raw))


def _find_header(path: Path, wanted: Axes | None) -> tuple[list[str], Axes]:
    """The line that names the axes, and their names. A file without one is read as the project's own, to say what is wrong."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            lines = list(islice(file, HEADER_LINES))
    except OSError:
        lines = []
    for line in lines:
        names = [name.strip().strip('"') for name in line.split(",")]
        axes = _known_axes(names) if wanted is None else wanted
        if axes is not None and set(axes) <= set(names):
            return names, axes
    read_table(path, TableLayout(axes=wanted or OWN_AXES, unit="g", time="time_s"))
    return ["time_s"], wanted or OWN_AXES


def _known_axes(names: list[str]) -> Axes | None:
    by_lower = {name.lower(): name for name in names}
    for stems in AXIS_STEMS:
        for suffix in ("", *UNIT_SUFFIXES):
            wanted = [stem + suffix for stem in stems]
            if all(name in by_lower for name in wanted):
                x, y, z = (by_lower[name] for name in wanted)
                return x, y, z
    return None


def _unit_of(column: str) -> Unit | None:
    return next((unit for suffix, unit in UNIT_SUFFIXES.items() if column.lower().endswith(suffix)), None)


def _guessed_unit(path: Path, raw: Floats) -> Unit:
    """From the numbers, where they leave no doubt."""
    norm = float(np.median(np.linalg.norm(raw, axis=1)))
    if np.all(raw == np.rint(raw)) and norm > 50:
        return "counts"
    if 0.7 < norm < 1.3:
        return "g"
    if 8.0 < norm < 11.5:
        return "m/s2"
    if 0.2 < norm < LARGEST_V:
        return "V"
    raise InputError(f"{path}: in which unit are its readings (|m| about {norm:.3g})? give --unit counts, V, g or m/s2")


def _session(path: Path, recording: Recording, unit: Unit) -> Session:
    raw = recording.raw / STANDARD_GRAVITY_M_S2 if unit == "m/s2" else recording.raw
    return Session(
        path=path,
        unit="g" if unit == "m/s2" else unit,
        time_s=recording.time_s,
        raw=raw,
        temperature_c=recording.temperature_c,
        left_out=recording.invalid + recording.repeated + recording.backward + recording.truncated,
    )
