"""One turn of a sensor about a horizontal shaft parallel to one of its axes (Łuczak et al. 2022, sec. 3).

The axis along the shaft reads a constant if it is parallel to it. If it is tilted towards another axis by e, it reads e times the
reading of that axis: a sine over the turn, with a peak-to-peak of 2 e (Zams and Łuczak 2024, eq. 2).
"""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array

N_SECTORS = 24
"""Sectors of a turn whose readings are averaged, 15 degrees each. Basis: a choice; 15 degrees each, in which the sine of a tilt
changes little, and several readings each."""
MIN_SECTORS = 20
"""Least number of sectors with a reading in a turn that counts. Basis: a choice; a turn by hand skips a few, and 60 degrees
missing leave both directions determined."""
MIN_ACROSS_G = 0.7
"""Least reading across the shaft, g; below it the shaft is not horizontal, or another axis lies along it. Basis: a shaft within
45 degrees of the horizontal."""
RANGE_OF_SECTORS = 3.9
"""Expected range of 24 values of a normal distribution, in standard deviations. Definition: for 24 values of a normal
distribution."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What one full turn shows."""

    axis: int
    """Axis along the shaft, 0 to 2."""
    peak_to_peak_g: float
    """Largest minus smallest mean of the sectors."""
    floor_g: float
    """Peak-to-peak that noise and quantisation cause with a perfect alignment."""
    towards: tuple[float, float, float]
    """Direction of the axis: its components along the others, rad; 0 for itself."""
    u_rad: float
    """Standard uncertainty of each component."""

    @property
    def misalignment_rad(self) -> float:
        """Angle between the axis and the shaft."""
        return float(np.hypot.reduce(self.towards))


def fit_turn(force_g: Array, axis: int, step_g: float = 0.0) -> Turn | None:
    """Return what the readings of one turn show, (n, 3), in g; None if too few sectors have readings.

    `step_g` is the quantisation step, LSB.
    """
    across = [other for other in range(3) if other != axis]
    sector = np.floor((turning_angle_rad(force_g, axis) / (2 * np.pi)) % 1 * N_SECTORS).astype(np.int64)
    filled, place = np.unique(sector % N_SECTORS, return_inverse=True)
    if len(filled) < MIN_SECTORS:
        return None
    count = np.bincount(place)
    mean_g = np.column_stack([np.bincount(place, values) / count for values in force_g.T])
    design = np.column_stack([mean_g[:, across], np.ones(len(mean_g))])
    found, *_ = np.linalg.lstsq(design, mean_g[:, axis], rcond=None)
    residual_g = mean_g[:, axis] - design @ found
    sigma_g = float(np.sqrt(residual_g @ residual_g / (len(mean_g) - 3)))
    towards = [0.0, 0.0, 0.0]
    for other, component in zip(across, found[:2].tolist(), strict=True):
        towards[other] = component
    return Turn(
        axis=axis,
        peak_to_peak_g=float(np.ptp(mean_g[:, axis])),
        floor_g=max(RANGE_OF_SECTORS * sigma_g, 2 * step_g),
        towards=(towards[0], towards[1], towards[2]),
        u_rad=float(np.hypot(sigma_g * np.sqrt(2 / len(mean_g)), step_g / np.sqrt(12))),
    )


def turning_angle_rad(force_g: Array, axis: int) -> Array:
    """Return the angle about the shaft of readings (n, 3), unwrapped, shape (n,)."""
    first, second = (other for other in range(3) if other != axis)
    return np.unwrap(np.arctan2(force_g[:, second], force_g[:, first]))


def shaft_axis(force_g: Array) -> int | None:
    """Return the axis along the shaft of readings (n, 3): the one about which they turn fully; None without a turn."""
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        is_horizontal = np.hypot(*force_g[:, across].T).min() > MIN_ACROSS_G
        if is_horizontal and np.ptp(turning_angle_rad(force_g, axis)) >= 2 * np.pi:
            return axis
    return None
