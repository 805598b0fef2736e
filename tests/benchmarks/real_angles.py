"""The angle over time where an encoder, a video or a motion capture knows it, and what a housing at the pivot would read."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.real_manifest import RealRecording

Array = NDArray[np.float64]
Angles = tuple[Array, Array]
"""Time stamps of the recording that is asked, s, and angles from vertical, rad, each of shape (n,)."""


def known_angles(recording: RealRecording, path: Path) -> Angles | None:
    """The independently known angle over the whole recording; None where only its largest value is known."""
    if recording.angle:
        time_s, angle_rad = _table_of_angles(recording, path)
        return time_s, np.abs(angle_rad)
    if recording.attitude:
        return _tilt_of_quaternion(recording, path)
    return None


def as_at_pivot(recording: RealRecording, path: Path, out: Path) -> Path:
    """Write f = (sin φ, 0, cos φ) g, turned by 45° about the rope, so that x and y both swing."""
    time_s, angle_rad = _table_of_angles(recording, path)
    lateral_g = np.sin(angle_rad) * np.sqrt(0.5)
    table = [time_s, lateral_g, lateral_g, np.cos(angle_rad)]
    header = "time_s,ax_g,ay_g,az_g"
    np.savetxt(out, np.column_stack(table), fmt="%.6f", delimiter=",", header=header, comments="")
    return out


def _table_of_angles(recording: RealRecording, path: Path) -> Angles:
    """Rows without numbers are left out, and times count from the first row of the file."""
    of = recording.angle
    rows = np.array(list(_numbers(path, [int(of["time_column"]), int(of["column"])])))
    time_s = (rows[:, 0] - rows[0, 0]) * of.get("time_unit_s", 1.0)
    angle_rad = rows[:, 1] * of.get("unit_rad", 1.0) - of.get("hanging_rad", 0.0)
    inside = (time_s >= of.get("from_s", 0.0)) & (time_s <= of.get("to_s", np.inf))
    return time_s[inside], angle_rad[inside]


def _tilt_of_quaternion(recording: RealRecording, path: Path) -> Angles:
    """Angle of the axis that is vertical where the quaternion is 1: `axis` 0, 1, 2 for x, y, z; w, x, y, z from `column` on."""
    of = recording.attitude
    first, axis = int(of["column"]), int(of["axis"])
    rows = np.array(list(_numbers(path, [int(of["time_column"]), *range(first, first + 4)])))
    quaternion = rows[:, 1:] / np.linalg.norm(rows[:, 1:], axis=1, keepdims=True)
    turned = [1 + each for each in range(3) if each != axis]
    cosine = 1 - 2 * (quaternion[:, turned] ** 2).sum(axis=1)
    return rows[:, 0], np.arccos(np.clip(cosine, -1, 1))


def _numbers(path: Path, columns: Sequence[int]) -> Iterator[list[float]]:
    for text in path.read_text(encoding="utf-8").splitlines():
        fields = re.split(r"\s*[,;]\s*|\s+", text.strip())
        try:
            yield [float(fields[column]) for column in columns]
        except (ValueError, IndexError):
            continue
