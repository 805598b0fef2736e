"""Reads one turn of a rotation calibration: the rig's angle and the readings of the three axes.

Columns: `angle_deg`, `ax_g,ay_g,az_g` (or `_v`, `_counts`), and optionally `count`, the number of readings that a row is the mean
of, and `temperature_c`. Several rows at one angle are averaged.
"""

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.methods.rotation_turn import TurnReadings
from gateway.calibration.offline.bench_table import read_columns, read_header
from gateway.errors import InputError
from gateway.numerics.array import Array

UNITS: dict[str, Literal["g", "V", "counts"]] = {"g": "g", "v": "V", "counts": "counts"}
"""Endings of the axis columns, with the unit of the record."""
MAX_ANGLES = 720
"""Most different angles of a turn: one per half degree."""


def read_turn(path: Path) -> tuple[TurnReadings, Literal["g", "V", "counts"]]:
    """Return the turn and its unit. Raises `InputError` with file, line and remedy."""
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
