"""The tables of bench measurements, read strictly: every column is known, every cell is a finite number."""

import csv
import math
from io import TextIOWrapper
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from devices.regular_file import open_regular
from gateway.bench.rotation_turn import TurnReadings
from gateway.bench.single_parameter import DisplacementPairs
from gateway.calibration.pose_finder import NORM_TOLERANCE
from gateway.errors import InputError
from gateway.file_input import reason_of
from gateway.numerics.array import Array

ROW_LIMIT = 1_000_000
"""A longer file is a recording. Basis: not a table of bench measurements."""
PAIR_COLUMNS = ("displacement_mm", "raw_angle_deg")
UNITS: dict[str, Literal["g", "V", "counts"]] = {"g": "g", "v": "V", "counts": "counts"}
"""Endings of the axis columns, with the unit of the record."""
MAX_ANGLES = 720
"""Most different angles of a turn. Basis: one per half degree."""


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
        raise InputError(f"{path}: cannot be read as CSV ({reason_of(error)}); name another file") from error
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


def read_pairs(paths: list[Path], u_displacement_m: float) -> DisplacementPairs:
    """Return the pairs of all files; `u_displacement_m` counts where a file has no column for it.

    Columns: `displacement_mm`, `raw_angle_deg`, optionally `u_displacement_mm`, and `photograph`, which may be any text. Each
    file is one session: its zero is that of all its rows.
    """
    displacement, u_displacement, angle, session = [], [], [], []
    for number, path in enumerate(paths):
        columns = read_columns(path, PAIR_COLUMNS, ("u_displacement_mm",), labels=("photograph",))
        rows = len(columns["displacement_mm"])
        u_mm = columns.get("u_displacement_mm", np.full(rows, 1000 * u_displacement_m))
        if np.any(u_mm <= 0):
            raise InputError(f"{path}: line {int(np.argmax(u_mm <= 0)) + 2}: u_displacement_mm is not above 0")
        displacement.append(columns["displacement_mm"] / 1000)
        u_displacement.append(u_mm / 1000)
        angle.append(np.radians(columns["raw_angle_deg"]))
        session.append(np.full(rows, number, dtype=np.int64))
    return DisplacementPairs(
        np.concatenate(displacement), np.concatenate(u_displacement), np.concatenate(angle), np.concatenate(session)
    )


def read_raw_angles(path: Path) -> Array:
    """Return raw relative angles, radians, shape (n,): column `raw_angle_deg`, relative to any zero."""
    return np.radians(read_columns(path, ("raw_angle_deg",))["raw_angle_deg"])


def read_turn(path: Path) -> tuple[TurnReadings, Literal["g", "V", "counts"]]:
    """Return one turn, the rig's angle and the readings of the three axes, and its unit.

    Columns: `angle_deg`, `ax_g,ay_g,az_g` (or `_v`, `_counts`), and optionally `count`, the number of readings that a row is the
    mean of, and `temperature_c`. Several rows at one angle are averaged. Raises `InputError` with file, line and remedy.
    """
    names = read_header(path)
    ending = next((ending for ending in UNITS if f"ax_{ending}" in names), "g")
    axes = tuple(f"a{axis}_{ending}" for axis in "xyz")
    columns = read_columns(path, ("angle_deg", *axes), ("count", "temperature_c"))
    counts = columns.get("count", np.ones(len(columns["angle_deg"])))
    if np.any(counts < 1) or np.any(counts != np.rint(counts)):
        line = int(np.argmax((counts < 1) | (counts != np.rint(counts)))) + 2
        raise InputError(f"{path}: line {line}: count is no whole number from 1; it is the number of readings averaged")
    readings = np.column_stack([columns[name] for name in axes])
    angles_deg, place = np.unique(np.round(columns["angle_deg"], 6), return_inverse=True)
    if len(angles_deg) > MAX_ANGLES:
        raise InputError(f"{path}: {len(angles_deg)} different angles; stop at {MAX_ANGLES} or fewer and average there")
    gravity = float(np.ptp(readings, axis=0).max()) / 2
    if ending == "g" and abs(gravity - 1) > NORM_TOLERANCE:
        raise InputError(
            f"{path}: gravity reads {gravity:.3g} g in it: the unit is another one than its header says; correct ax_g, ay_g, "
            "az_g to _v or _counts, or divide m/s2 by 9.80665"
        )
    total = np.bincount(place, counts).astype(np.float64)
    mean = np.column_stack([np.bincount(place, counts * values) for values in readings.T]) / total[:, None]
    temperature = columns.get("temperature_c")
    turn = TurnReadings(
        source=str(path),
        angle_rad=np.radians(angles_deg),
        mean=mean,
        count=total,
        reading_sigma=_reading_sigma(readings, counts, mean, place),
        temperature_c=None if temperature is None else np.bincount(place, counts * temperature) / total,
    )
    return turn, UNITS[ending]


def _reading_sigma(readings: Array, counts: Array, mean: Array, place: NDArray[np.intp]) -> Array | None:
    """Return the standard deviation of one reading from repeated rows at one angle, shape (3,); None without repeats."""
    freedom = len(readings) - len(mean)
    if freedom == 0:
        return None
    deviation = readings - mean[place]
    return np.asarray(np.sqrt((counts[:, None] * deviation**2).sum(axis=0) / freedom))
