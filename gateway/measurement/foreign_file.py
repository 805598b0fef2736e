"""Recordings of other programs: text tables, and the arrays of MATLAB files."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.errors import RecordingError
from devices.recording import Recording
from devices.tables.columns import RECORD_GRAVITY
from devices.tables.foreign import TableOptions, read_foreign_table
from gateway.errors import InputError
from gateway.measurement.matlab import write_matlab_table
from gateway.swing.data.input_checks import lacks_gravity


def read_foreign(path: Path, options: TableOptions) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording in g, and what was found of its columns and units. Raises `RecordingError` or `InputError`."""
    if path.suffix.lower() == ".mat":
        return _read_matlab(path, options)
    return _in_g(path, options)


def _read_matlab(path: Path, options: TableOptions) -> tuple[Recording, tuple[str, ...]]:
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv"
        write_matlab_table(path, table, options.columns)
        try:
            return _in_g(table, options)
        except (RecordingError, InputError) as error:
            raise type(error)(str(error).replace(str(table), str(path))) from error


def _in_g(path: Path, options: TableOptions) -> tuple[Recording, tuple[str, ...]]:
    table = read_foreign_table(path, options)
    recording = table.recording
    if table.unit in ("counts", "V"):
        if options.units_per_g is None:
            raise InputError(f"{path}: is in {table.unit}; give --units-per-g, how many {table.unit} are 1 g")
        recording = replace(recording, raw=recording.raw / options.units_per_g, unit="g")
    _check_gravity(path, recording.raw)
    return recording, table.findings


def _check_gravity(path: Path, force_g: NDArray[np.float64]) -> None:
    """Raise `InputError` for readings whose mean is not gravity."""
    if lacks_gravity(force_g):
        raise InputError(
            f"{path}: the mean reading is not gravity: gravity was removed, or the sensor was turned over; "
            f"let the sensor hang, and {RECORD_GRAVITY}"
        )
