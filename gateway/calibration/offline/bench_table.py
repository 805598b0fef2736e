"""Reads the tables of bench measurements strictly: every column is known, every cell is a finite number."""

import csv
import math
from io import TextIOWrapper
from pathlib import Path

import numpy as np

from devices.regular_file import open_regular
from gateway.errors import InputError
from gateway.numerics.array import Array

ROW_LIMIT = 1_000_000
"""A longer file is a recording, not a table of bench measurements."""


def read_header(path: Path) -> list[str]:
    """Return the names in the first line. Raises `InputError` if the file cannot be read or is empty."""
    rows = _read_rows(path)
    return rows[0]


def read_columns(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...] = (), labels: tuple[str, ...] = ()
) -> dict[str, Array]:
    """Return the columns of a CSV file by name, each of shape (n,), n at least 1; an optional one may be missing.

    Columns in `labels` may have any text and are not returned.

    Raises `InputError` that names file, line and remedy for a missing or unknown column and for a cell that is no finite number.
    """
    names, *rows = _read_rows(path)
    _check_names(path, names, required, (*optional, *labels))
    if not rows:
        raise InputError(f"{path}: no rows below the header; each measurement is one row")
    values = [_parse_row(path, number, names, row, labels) for number, row in enumerate(rows, start=2)]
    return dict(zip([name for name in names if name not in labels], np.array(values).T, strict=True))


def _read_rows(path: Path) -> list[list[str]]:
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8-sig", newline="") as file:
            rows = [
                [cell.strip() for cell in row] for row, _ in zip(csv.reader(file), range(ROW_LIMIT + 1), strict=False)
            ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({error}); name another file") from error
    while rows and not any(rows[-1]):
        rows.pop()
    if not rows:
        raise InputError(f"{path}: the file is empty; its first line names the columns")
    if len(rows) > ROW_LIMIT:
        raise InputError(f"{path}: more than {ROW_LIMIT} rows; average the readings of each measurement")
    return rows


def _check_names(path: Path, names: list[str], required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    known = ",".join([*required, *(f"[{name}]" for name in optional)])
    for name in required:
        if name not in names:
            raise InputError(f"{path}: line 1: no column {name}; the columns are {known}")
    for name in names:
        if name not in (*required, *optional):
            raise InputError(f"{path}: line 1: column {name!r} is unknown; the columns are {known}")
        if names.count(name) > 1:
            raise InputError(f"{path}: line 1: column {name} occurs {names.count(name)} times; keep one")


def _parse_row(path: Path, number: int, names: list[str], row: list[str], labels: tuple[str, ...]) -> list[float]:
    if len(row) != len(names):
        raise InputError(f"{path}: line {number}: {len(row)} cells, the header has {len(names)}; complete the row")
    values = []
    for name, cell in zip(names, row, strict=True):
        if name in labels:
            continue
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f"{path}: line {number}: {name} is {cell!r}, not a number; correct or remove the row")
        values.append(value)
    return values
