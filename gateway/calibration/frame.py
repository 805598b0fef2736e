"""The housing's frame: how the axes of the sensor lie in the housing."""

import numpy as np

from devices.axes_map import AxesMap
from gateway.numerics.array import Array


def housing_rotation(axes: AxesMap) -> Array:
    """Return the rotation from the sensor's to the housing's axes, shape (3, 3)."""
    rotation = np.zeros((3, 3))
    for housing_axis, (sensor_axis, sign) in enumerate(axes):
        rotation[housing_axis, sensor_axis] = sign
    return rotation
