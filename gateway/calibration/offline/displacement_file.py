"""Reads pairs of laser displacement and raw angle, and raw angles to correct.

Pairs: `displacement_mm`, `raw_angle_deg`, optionally `u_displacement_mm`, and `photograph`, which may be any text. Each file is
one session: its zero is that of all its rows. Angles: `raw_angle_deg`, relative to any zero.
"""

from pathlib import Path

import numpy as np

from gateway.calibration.methods.single_parameter import DisplacementPairs
from gateway.calibration.offline.bench_table import read_columns
from gateway.errors import InputError
from gateway.numerics.array import Array

PAIR_COLUMNS = ("displacement_mm", "raw_angle_deg")


def read_pairs(paths: list[Path], u_displacement_m: float) -> DisplacementPairs:
    """Return the pairs of all files; `u_displacement_m` counts where a file has no column for it."""
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
    """Return raw relative angles, radians, shape (n,)."""
    return np.radians(read_columns(path, ("raw_angle_deg",))["raw_angle_deg"])
