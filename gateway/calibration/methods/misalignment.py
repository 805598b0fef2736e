"""Misalignment angles of the sensitive axes (Łuczak et al. 2022, eq. 13 to 18), with the horizontal pairs found from the data.

The equations as printed exchange the pairs of x and y: an axis is horizontal in the pairs of faces of the two *other* axes. Order
and sign are those of the source's positions: pair 1-2 is -x minus +x, pair 3-4 is +z minus -z, pair 5-6 is -y minus +y.
"""

import numpy as np

from gateway.numerics.array import Array

PAIR_ORDER = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}
"""For each axis, the axes whose faces are its two horizontal pairs."""
PAIR_SIGN = (-1.0, -1.0, 1.0)
"""For each axis, the sign of the end that points up in the first position of its pair."""


def misalignment_deg(sensitivity: Array) -> dict[str, list[float]]:
    """Return the two misalignment angles of each axis, degrees.

    `sensitivity`, shape (3, 3), raw units per g: its row is the axis that reads, its column the axis that points up.
    """
    ratio = np.clip(sensitivity / np.diag(sensitivity)[:, None], -1, 1)
    return {
        name: [float(np.degrees(np.arcsin(PAIR_SIGN[pair] * ratio[axis, pair]))) for pair in PAIR_ORDER[name]]
        for axis, name in enumerate("xyz")
    }
