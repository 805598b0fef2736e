"""Reads recordings for a calibration: the project's CSV, or a table in counts, volts, m/s² or g from elsewhere."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from devices.tables.foreign import TableOptions, UnitRange, read_foreign_table
from gateway.numerics.array import Array

RANGES_AT_REST = (
    UnitRange("counts", 50.0, np.inf),
    UnitRange("g", 0.7, 1.3),
    UnitRange("m/s2", 8.0, 11.5),
    UnitRange("V", 0.2, 7.0),
)
"""Ranges of the median magnitude of the readings of an uncalibrated sensor at rest; in V: three outputs near the middle of a
supply of at most 5 V. Basis: 9.81 m/s2 within the sensitivity and offset of an uncalibrated sensor."""


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


def read_file(path: Path, options: TableOptions) -> FileReadings:
    """Read one file. Raises `RecordingError` with the file and the remedy."""
    table = read_foreign_table(path, options, RANGES_AT_REST)
    recording = table.recording
    return FileReadings(
        path=path,
        unit=table.unit if table.unit in ("counts", "V") else "g",
        time_s=recording.time_s,
        raw=recording.raw,
        temperature_c=recording.temperature_c,
        n_skipped=recording.invalid + recording.repeated + recording.backward + recording.truncated,
        unit_is_stated=options.unit is not None,
    )
