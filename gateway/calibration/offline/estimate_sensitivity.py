"""Estimates the nominal sensitivity of a sensor from the readings, to within the tolerance of the pose finder."""

from collections.abc import Sequence

import numpy as np

from gateway.calibration.offline.readings_file import FileReadings
from gateway.calibration.poses.pose import NominalSensitivity
from gateway.calibration.poses.pose_finder import NORM_TOLERANCE
from gateway.calibration.record import NotDeterminedError
from gateway.numerics.array import Array

AVERAGED_READINGS = 16
"""Number of readings that are averaged before their extremes are taken, so that noise and knocks do not count. Basis: a choice;
noise falls to a quarter, and a turned sensor stays for longer."""
EXTREME_QUANTILE = 0.01
"""Quantile of the averages that counts as their minimum, and one minus it as their maximum. Basis: a choice; knocks are rarer,
and a face is held for longer."""
MIN_HALF_RANGE_UNITS = 0.02
"""Half range, raw units, below which a sensor was not turned: noise alone. Basis: a choice; noise of any sensor is smaller in its
unit, and a turned one has 1 g or more."""
MAX_DIGITAL_ZERO_G = 0.5
"""Largest zero of a digital sensor, g; a larger one is that of an analogue sensor, in the middle of its supply voltage. Basis: a
choice; data sheets state less for digital sensors, and 1.5 V are several g."""


def estimate_sensitivity(files: Sequence[FileReadings], units_per_g: float | None) -> NominalSensitivity:
    """Return nominal sensitivity and zero. Raises `NotDeterminedError` if the readings do not determine them."""
    unit = files[0].unit
    means = np.concatenate([_block_means(one.raw) for one in files])
    norm = float(np.median(np.linalg.norm(means, axis=1)))
    if unit == "g" and abs(norm - 1) <= NORM_TOLERANCE:
        return NominalSensitivity(1.0)
    analogue = _estimate_from_extremes(means, units_per_g)
    if analogue is not None:
        zero_g = np.max(np.abs(analogue.zero)) / analogue.units_per_g
        if unit == "V" or zero_g > MAX_DIGITAL_ZERO_G:
            return analogue
    if unit == "V":
        raise NotDeterminedError(
            "the readings do not determine volts per g: every axis has to point up once and down once; take the missing poses"
        )
    return NominalSensitivity(units_per_g or norm)


def _block_means(raw: Array) -> Array:
    n_used = len(raw) // AVERAGED_READINGS * AVERAGED_READINGS
    return raw[:n_used].reshape(-1, AVERAGED_READINGS, 3).mean(axis=1) if n_used else raw


def _estimate_from_extremes(means: Array, units_per_g: float | None) -> NominalSensitivity | None:
    """Return the zero between the extremes of each axis, or at its median if the axis has one extreme only.

    None if an axis was not turned.
    """
    low, middle, high = np.quantile(means, [EXTREME_QUANTILE, 0.5, 1 - EXTREME_QUANTILE], axis=0)
    zero, half = (low + high) / 2, (high - low) / 2
    scale = units_per_g or float(half.max())
    least_half_range = (1 - NORM_TOLERANCE) * scale
    zero = np.where(half > least_half_range, zero, middle)
    if scale < MIN_HALF_RANGE_UNITS or np.any(np.maximum(high - zero, zero - low) < least_half_range):
        return None
    x, y, z = zero.tolist()
    return NominalSensitivity(scale, (x, y, z))
