"""Recordings of other programs: text tables, and the arrays of MATLAB files as the columns of a table."""

import os
import struct
import tempfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.errors import RecordingError
from devices.recording import Recording
from devices.regular_file import open_regular
from devices.tables.columns import RECORD_GRAVITY
from devices.tables.foreign import TableOptions, read_foreign_table
from gateway.errors import InputError
from gateway.extras import require_extra
from gateway.swing.data.input_checks import lacks_gravity

LEAST_BYTES = 16_000_000
"""So many bytes are decompressed of every file. Basis: a choice; some minutes of a fast sensor, and little memory."""
MAX_EXPANSION = 4
"""So many more bytes are decompressed for each byte of the file. Basis: noise of 12 bits in numbers of 64
compresses to a quarter; zeros compress to a thousandth, and a megabyte of them took 3 GB."""
HDF5_VERSION = 2
"""Of files of MATLAB 7.3. Definition: `scipy.io.matlab.matfile_version`."""
HEADER_BYTES = 128
"""Definition: the header of a MATLAB 5 file."""
COMPRESSED = 15
"""Definition: the type of an element that is compressed."""
PART_BYTES = 1 << 20
"""Bytes that are decompressed at once. Basis: a choice; more is not faster, and a small board has the memory."""
MIN_ROWS = 3
"""Basis: a choice; a shorter array is a constant or a vector, and no recording."""
MAX_COLUMNS = 64
"""An array with more columns than this is no table of readings. Basis: a choice; measuring systems have fewer channels, and
images more columns."""


def write_matlab_table(path: Path, table: Path, columns: Sequence[str] | None) -> None:
    """Write the arrays of equal length as a CSV with their names: those with the first of `columns`, or else the most.

    A matrix `acc` with three columns gives acc_x, acc_y, acc_z, with another number acc_1, acc_2, ... Fields of a structure and
    cells are `name_field` and `name_1`. Raises `InputError`.
    """
    arrays = dict(_columns(_load(path)))
    by_length: dict[int, dict[str, NDArray[np.float64]]] = {}
    for name, values in arrays.items():
        by_length.setdefault(len(values), {})[name] = values
    if not by_length:
        raise InputError(f"{path}: has no array of numbers with {MIN_ROWS} rows or more")
    wanted = None if columns is None else columns[0]
    group = next((group for group in by_length.values() if wanted in group), None)
    group = group or max(by_length.values(), key=len)
    rows = np.column_stack(list(group.values()))
    np.savetxt(table, rows, delimiter=",", header=",".join(group), comments="", fmt="%.17g")


def _load(path: Path) -> Mapping[str, Any]:
    require_extra("twin", ["scipy"])
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError, matfile_version

    if not path.exists():
        raise InputError(f"{path}: no such file; check the path")
    _check_expansion(path)
    try:
        major, _ = matfile_version(path)
        if major == HDF5_VERSION:
            raise InputError(f"{path}: is a MATLAB file of version 7.3; save it with -v7, or export it as CSV")
        content: Mapping[str, Any] = loadmat(path, squeeze_me=True, struct_as_record=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (MatReadError, ValueError, TypeError, KeyError, IndexError, EOFError) as error:
        raise InputError(f"{path}: is no MATLAB file ({error})") from error
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _check_expansion(path: Path) -> None:
    """Raise `InputError` where the elements of a file are far larger than the file, or it cannot be read."""
    try:
        with open_regular(path) as file:
            order = "<" if file.read(HEADER_BYTES)[-2:] == b"IM" else ">"
            left = LEAST_BYTES + MAX_EXPANSION * os.fstat(file.fileno()).st_size
            while len(tag := file.read(8)) == 8:
                kind, length = struct.unpack(f"{order}II", tag)
                if kind == COMPRESSED:
                    left -= _expanded_bytes(file.read(min(length, left)), left)
                else:
                    file.seek(length, os.SEEK_CUR)
                if left <= 0:
                    raise InputError(
                        f"{path}: contains far more than files of its size do; save it with -v6, without compression, or cut it"
                    )
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _expanded_bytes(data: bytes, most: int) -> int:
    """Return the length of compressed data, at most little more than `most`; 0 for damaged ones, which scipy reports."""
    reader, count = zlib.decompressobj(), 0
    while data and count <= most and not reader.eof:
        try:
            part = reader.decompress(data, PART_BYTES)
        except zlib.error:
            return 0
        count, data = count + len(part), reader.unconsumed_tail
    return count


def _columns(content: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[np.float64]]]:
    for name, value in content.items():
        yield from _array_columns(name, np.asarray(value))


def _array_columns(name: str, array: NDArray[Any]) -> Iterator[tuple[str, NDArray[np.float64]]]:
    if array.dtype.names is not None and array.ndim == 0:
        for field in array.dtype.names:
            yield from _array_columns(f"{name}_{field}", np.asarray(array[field].item()))
    elif array.dtype == object:
        for number, cell in enumerate(array.ravel(), start=1):
            yield from _array_columns(f"{name}_{number}", np.asarray(cell))
    elif array.dtype.kind in "iuf" and array.ndim in (1, 2) and max(array.shape) >= MIN_ROWS:
        table = array.astype(np.float64).reshape(len(array), -1)
        table = table.T if table.shape[0] < table.shape[1] else table
        if table.shape[1] <= MAX_COLUMNS:
            suffixes = [""] if table.shape[1] == 1 else _suffixes(table.shape[1])
            for place, suffix in enumerate(suffixes):
                yield f"{name}{suffix}", table[:, place]


def _suffixes(count: int) -> list[str]:
    return ["_x", "_y", "_z"] if count == 3 else [f"_{number}" for number in range(1, count + 1)]


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
