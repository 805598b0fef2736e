"""Misalignment angles of the sensitive axes (000 eq. 13-18), with the horizontal pairs found from the data.

As printed, the equations list the x and y pairs the other way round: an axis is horizontal in the pairs of faces of the two
*other* axes. Order and sign are those of the source's positions: pair 1-2 is -x less +x, 3-4 is +z less -z, 5-6 is -y less +y.
"""

import numpy as np

from gateway.calibration.poses.pose import Array

PAIR_ORDER = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}
"""For each axis, the axes whose faces make its two horizontal pairs."""
PAIR_SIGN = (-1.0, -1.0, 1.0)
"""The first position of the source's pair has this end of the axis up."""


def inverse(matrix: Array) -> Array:
    """The sensitivity of a correction matrix, and the other way round, shape (3, 3)."""
    return np.asarray(np.linalg.inv(matrix))


def misalignment_deg(sensitivity: Array) -> dict[str, list[float]]:
    """Angles in degrees of `sensitivity`, shape (3, 3): row the axis that reads, column the axis that points up; unit per g."""
    ratio = np.clip(sensitivity / np.diag(sensitivity)[:, None], -1, 1)
    return {
        name: [float(np.degrees(np.arcsin(PAIR_SIGN[pair] * ratio[axis, pair]))) for pair in PAIR_ORDER[name]]
        for axis, name in enumerate("xyz")
    }
