"""Recordings as text: the project's own CSV, and foreign tables described by a `TableLayout`.

Faults are counted by kind and never guessed at: a row that cannot be used is left out, and the gap remains visible in the
sample times. A file is refused only if it cannot be understood as a whole.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from devices.errors import RecordingError
from devices.recording import Recording, SampleRows, recording_from_rows
from devices.regular_file import open_regular
from devices.tables.layout import (
    NATIVE,
    Column,
    TableLayout,
    plain_row,
    required_columns,
    seconds_of,
    split_line,
)

BLOCK_CHARS = 1 << 20
"""Characters that are read at once. Basis: a choice; more is not faster, and a small board has the memory."""
MAX_BYTES = 256_000_000
"""Largest table that is read. Basis: some six million rows, which need 2 GB of memory."""
HEADER_LINES = 64
"""The header, or the first row of numbers, must be within this many lines. Basis: a choice; headers of loggers have some tens of
lines."""
BINARY = re.compile(rb"[\x00-\x08\x0e-\x1a]")
TIME_LIMIT_S = 4e9
"""A larger number is not a time in seconds. Basis: beyond the year 2096 in Unix seconds; differences still fit int64
nanoseconds."""
READING_LIMIT = 2.0**31
"""A larger number is a damaged row. Definition: the range of the widest sensor, 32 bits."""


@dataclass(frozen=True, slots=True)
class _Columns:
    """A layout applied to one file."""

    used: tuple[int, ...]
    """0-based numbers of the columns, in the order time, axes, temperature, gyro."""
    width: int
    """Number of columns in every row."""
    required: int
    """This many of the first columns in `used` must have a number in every row."""
    temperature: int | None
    """Index in `used`."""
    gyro: int | None
    """Index of the first of three in `used`."""
    first_row: int
    """Number of lines of the header."""


@dataclass(slots=True)
class _ReadRows:
    """The rows read so far."""

    places: list[NDArray[np.int64]] = field(default_factory=list)
    """Index of each row of numbers among all rows that are not blank."""
    values: list[NDArray[np.float64]] = field(default_factory=list)
    """One row per entry of `places`, columns as in `_Columns.used`."""
    count: int = 0
    blank: int = 0
    truncated: int = 0


def read_table(path: Path | str, layout: TableLayout = NATIVE) -> Recording:
    """Read a recording. Raises `RecordingError`, which names the file, the place and the remedy."""
    path = Path(path)
    try:
        _check_text(path)
        with TextIOWrapper(open_regular(path), encoding="utf-8-sig", errors="replace") as file:
            _check_size(path, file.fileno())
            columns, read = _read_rows(path, file, layout)
    except OSError as error:
        raise RecordingError(_access_text(path, error)) from error
    rows = _to_sample_rows(layout, columns, read)
    try:
        return recording_from_rows(rows, layout.unit, read.blank, read.truncated)
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error


def _access_text(path: Path, error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return f"{path}: no such file; check the path"
    if isinstance(error, IsADirectoryError):
        return f"{path}: is a directory; name the recording in it"
    if isinstance(error, PermissionError):
        return f"{path}: may not be read by this user; change its owner or mode"
    return f"{path}: cannot be read ({error.strerror}); copy it to another disk and try again"


def _check_text(path: Path) -> None:
    with open_regular(path) as file:
        head = file.read(512)
    if not head.strip():
        raise RecordingError(f"{path}: is empty; choose another recording")
    if found := BINARY.search(head):
        raise RecordingError(
            f"{path}: is not UTF-8 text (byte {found.group()[0]:#04x} at {found.start()}); export it as CSV"
        )


def _check_size(path: Path, descriptor: int) -> None:
    size = os.fstat(descriptor).st_size
    if size > MAX_BYTES:
        raise RecordingError(
            f"{path}: has {size / 1e6:.0f} MB; a table of at most {MAX_BYTES / 1e6:.0f} MB is read into memory; cut it into parts"
        )


def _blocks_of_lines(file: TextIO) -> Iterator[tuple[list[str], bool]]:
    """Yield groups of complete lines, and whether the last of them ended with a newline."""
    carry = ""
    while text := file.read(BLOCK_CHARS):
        lines = (carry + text).split("\n")
        carry = lines.pop()
        if len(carry) > BLOCK_CHARS:  # not a line of any table
            lines.append(carry)
            carry = ""
        if lines:
            yield lines, True
    if carry:
        yield [carry], False


def _read_rows(path: Path, file: TextIO, layout: TableLayout) -> tuple[_Columns, _ReadRows]:
    read = _ReadRows()
    columns: _Columns | None = None
    previous = ""
    for block, ended in _blocks_of_lines(file):
        lines = [plain_row(line) for line in block]
        if columns is None:
            columns = _find_columns(path, lines[:HEADER_LINES], layout)
            lines = lines[columns.first_row :]
        whole = lines if ended or _is_whole(lines, previous, layout) else []
        _add_lines(read, whole, columns, layout)
        read.truncated += len(lines) - len(whole)
        previous = lines[-1] if lines else ""
    if columns is None:
        raise RecordingError(f"{path}: is empty; choose another recording")
    return columns, read


def _is_whole(lines: list[str], previous: str, layout: TableLayout) -> bool:
    """Return whether a last line without a newline is complete: its last number has as many decimals as in the row before."""
    decimals = [len(split_line(line, layout)[-1].partition(".")[2]) for line in (*lines, previous) if line.strip()]
    return len(decimals) == 2 and decimals[0] >= decimals[1] > 0


def _find_columns(path: Path, lines: list[str], layout: TableLayout) -> _Columns:
    by_name = isinstance(layout.axes[0], str)
    for number, line in enumerate(lines):
        entries = split_line(line, layout)
        found = _columns_by_name(path, entries, layout) if by_name else _columns_by_number(entries, layout)
        if found is not None:
            return _resolve_columns(found, len(entries), layout, first_row=number + 1 if by_name else number)
    first = next((line for line in lines if line.strip()), "")
    entries = split_line(first, layout)
    shown = ", ".join(entries[:12])[:160].encode("ascii", "replace").decode()
    needed = ", ".join(str(column) for column in required_columns(layout))
    if by_name:
        raise RecordingError(f"{path}: no header with the columns {needed}; its first line has: {shown}")
    raise RecordingError(
        f"{path}: no line with numbers in the columns {needed}; its first line has {len(entries)}: {shown}"
    )


def _columns_by_name(path: Path, entries: list[str], layout: TableLayout) -> dict[Column, int] | None:
    if not set(required_columns(layout)) <= set(entries):
        return None
    twice = [entry for entry in required_columns(layout) if isinstance(entry, str) and entries.count(entry) > 1]
    if twice:
        raise RecordingError(f"{path}: column {twice[0]} occurs twice in its header; rename one")
    return {entry: place for place, entry in enumerate(entries)}


def _columns_by_number(entries: list[str], layout: TableLayout) -> dict[Column, int] | None:
    found: dict[Column, int] = {place + 1: place for place in range(len(entries))}
    needed = [entries[found[column]] for column in required_columns(layout) if column in found]
    if len(needed) < len(required_columns(layout)) or _parse_numbers(needed, len(needed), layout) is None:
        return None
    return found


def _resolve_columns(found: dict[Column, int], count: int, layout: TableLayout, first_row: int) -> _Columns:
    used = [found[column] for column in required_columns(layout)]
    required = len(used)
    temperature = gyro = None
    if layout.temperature_c in found:
        temperature = len(used)
        used.append(found[layout.temperature_c])
    if layout.gyro_dps is not None and set(layout.gyro_dps) <= set(found):
        gyro = len(used)
        used += [found[column] for column in layout.gyro_dps]
    return _Columns(tuple(used), count, required, temperature, gyro, first_row)


def _add_lines(read: _ReadRows, lines: list[str], columns: _Columns, layout: TableLayout) -> None:
    rows = [line for line in lines if line.strip(" \t,;")]
    delimiter = layout.delimiter
    width = [len(line.split()) if delimiter == " " else line.count(delimiter) + 1 for line in rows]
    full = np.flatnonzero(np.array(width) == columns.width)
    places, values = _parse_lines([rows[place] for place in full], columns, layout)
    read.places.append(read.count + full[places])
    read.values.append(values)
    read.count += len(rows)
    read.blank += len(lines) - len(rows)


def _parse_lines(
    lines: list[str], columns: _Columns, layout: TableLayout
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the indices of the lines that have numbers, and the numbers; in one call if all lines are correct."""
    if lines and layout.decimal == "." and not layout.time_is_text:
        try:
            split_at = None if layout.delimiter == " " else layout.delimiter
            values = np.loadtxt(lines, delimiter=split_at, usecols=columns.used, comments=None, ndmin=2)
            return np.arange(len(lines)), values
        except ValueError:
            pass
    split = (split_line(line, layout) for line in lines)
    parsed = [
        _parse_numbers([entries[column] for column in columns.used], columns.required, layout) for entries in split
    ]
    found = [place for place, row in enumerate(parsed) if row is not None]
    values = np.array([parsed[place] for place in found], dtype=np.float64)
    return np.array(found, dtype=np.int64), values.reshape(-1, len(columns.used))


def _parse_numbers(entries: list[str], required: int, layout: TableLayout) -> list[float] | None:
    """Return the numbers of one row; an empty entry after the first `required` is NaN. None: it is not a row of numbers."""
    filled = entries[:required] + [entry or "nan" for entry in entries[required:]]
    try:
        if layout.time_is_text and layout.time is not None:
            return [seconds_of(filled[0]), *map(float, filled[1:])]
        return [float(entry) for entry in filled]
    except ValueError:
        return None


def _to_sample_rows(layout: TableLayout, columns: _Columns, read: _ReadRows) -> SampleRows:
    """Convert to seconds; impossible times and readings become NaN."""
    place = np.concatenate(read.places)
    values = np.concatenate(read.values)
    rate_hz = layout.rate_hz or 1.0
    time = place.astype(np.float64) if layout.time is None else values[:, 0]
    if layout.time_is_text:  # seconds since 1970 or midnight say nothing to a reader
        time = time - time[0]
    raw = values[:, columns.required - 3 : columns.required]
    broken = ~(np.abs(raw) < READING_LIMIT)
    if layout.unit == "counts":
        broken |= np.rint(raw) != raw
    raw = np.where(broken, np.nan, raw)
    return SampleRows(
        place=place,
        count=read.count,
        time_s=np.where(np.abs(time) < TIME_LIMIT_S * rate_hz, time, np.nan) / rate_hz,
        raw=raw,
        temperature_c=None if columns.temperature is None else values[:, columns.temperature],
        gyro_dps=None if columns.gyro is None else layout.gyro_scale * values[:, columns.gyro : columns.gyro + 3],
    )
