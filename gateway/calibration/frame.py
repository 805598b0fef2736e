"""The housing's frame: how the axes of the sensor lie in the housing."""

import numpy as np

from gateway.numerics.array import Array

AxesMap = tuple[tuple[int, int], ...]
"""For each housing axis the index and the sign of the sensor axis along it."""


def housing_rotation(axes: AxesMap) -> Array:
    """Return the rotation from the sensor's to the housing's axes, shape (3, 3)."""
    rotation = np.zeros((3, 3))
    for housing_axis, (sensor_axis, sign) in enumerate(axes):
        rotation[housing_axis, sensor_axis] = sign
    return rotation
