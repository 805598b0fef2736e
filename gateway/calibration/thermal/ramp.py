"""A temperature ramp: the readings of a sensor at rest in one attitude while its temperature changes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.calibration.offline.readings_file import FileReadings
from gateway.calibration.poses.faces import find_face
from gateway.calibration.poses.nominal_sensitivity import NominalSensitivity
from gateway.calibration.poses.pose import Face
from gateway.calibration.record import NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array

AVERAGE_S = 0.5
"""Duration of an average, s; 20 Hz were averaged to 2 Hz (Sawicki and Walendziuk 2016, sec. 3)."""
N_BINS = 40
"""Number of temperature bins of a ramp."""
MIN_BIN_C = 0.25
"""Smallest width of a bin, °C: several steps of a sensor's own thermometer."""
MIN_RANGE_C = 10.0
"""Smallest range of a ramp, °C: at 0.1 mg/°C the offset changes by 1 mg."""
MIN_BINS = 8
"""Least number of bins of a ramp, so that a curvature and the scatter show."""
MAX_MOTION_G = 0.025
"""Largest deviation of an average from the curve of its bins, g: beyond it the sensor was moved."""


@dataclass(frozen=True, slots=True)
class Ramp:
    """The means of a ramp in bins of temperature, b of them, at rising temperatures."""

    path: Path
    face: Face
    temperature_c: Array
    """Mean temperature of each bin, °C, shape (b,)."""
    mean: Array
    """Mean readings, raw, shape (b, 3)."""
    noise: Array
    """Standard deviation of a reading within the averages, raw, shape (3,)."""
    count: int
    """Number of readings."""


def bin_ramp(readings: FileReadings, nominal: NominalSensitivity) -> Ramp:
    """Return the ramp of one recording.

    Raises `InputError` without temperatures, `NotDeterminedError` for a ramp that is too small, moves or lies on no face.
    """
    path = readings.path
    if readings.temperature_c is None or np.isnan(readings.temperature_c).all():
        raise InputError(
            f"{path}: has no temperature; a ramp needs the column temperature_c, or an .mcap whose device reports it"
        )
    known = ~np.isnan(readings.temperature_c)
    time_s, raw, temperature_c = readings.time_s[known], readings.raw[known], readings.temperature_c[known]
    group = np.floor((time_s - time_s[0]) / AVERAGE_S).astype(np.int64)
    means, mean_c, noise = _average(group, raw, temperature_c)
    width_c = max(float(np.ptp(mean_c)) / N_BINS, MIN_BIN_C)
    binned, binned_c, _ = _average(np.floor((mean_c - mean_c.min()) / width_c).astype(np.int64), means, mean_c)
    if np.ptp(binned_c) < MIN_RANGE_C or len(binned) < MIN_BINS:
        raise NotDeterminedError(
            f"{path}: the temperature changes by {np.ptp(mean_c):.1f} °C; a ramp needs {MIN_RANGE_C:.0f} °C or more"
        )
    face = find_face(nominal.in_g(binned.mean(axis=0)))
    if face is None:
        raise NotDeterminedError(f"{path}: lies on no face; a ramp needs one axis up or down throughout")
    curve = np.column_stack([np.interp(mean_c, binned_c, axis) for axis in binned.T])
    moved_g = float(np.max(np.abs(means - curve))) / nominal.units_per_g
    if moved_g > MAX_MOTION_G + 6 * float(noise.max()) / nominal.units_per_g:
        raise NotDeterminedError(f"{path}: a reading stands {moved_g * 1000:.0f} mg off its ramp: the sensor was moved")
    return Ramp(path, face, binned_c, binned, noise, len(raw))


def _average(group: Array, values: Array, temperature_c: Array) -> tuple[Array, Array, Array]:
    """Return the means of the groups in rising order, their mean temperatures, and the scatter of a value within groups."""
    _, place = np.unique(group, return_inverse=True)
    count = np.bincount(place)
    means = np.column_stack([np.bincount(place, axis) / count for axis in values.T])
    freedom = max(len(values) - len(count), 1)
    scatter = np.sqrt(((values - means[place]) ** 2).sum(axis=0) / freedom)
    return means, np.bincount(place, temperature_c) / count, scatter
