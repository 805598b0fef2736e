"""Conversion between the output of an accelerometer and specific force (Sawicki and Walendziuk 2016, eq. 1 to 10).

For numbers and arrays, in one unit of the output throughout: volts of an analogue part, counts of a digital one. A digital part
has a zero-g output too, though data sheets may not state it (Table 4).
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Value = TypeVar("Value", float, NDArray[np.float64])


def force_g(output: Value, zero_g_output: Value | float, units_per_g: Value | float) -> Value:
    """Return the specific force, g, from the output (eq. 2 and 3; eq. 6 with a zero-g output of 0)."""
    force: Value = (output - zero_g_output) / units_per_g
    return force


def sensor_output(force: Value, zero_g_output: Value | float, units_per_g: Value | float) -> Value:
    """Return the output at a specific force in g (eq. 7)."""
    output: Value = units_per_g * force + zero_g_output
    return output


def zero_g_output(plus_1g: Value, minus_1g: Value) -> Value:
    """Return the output at zero g from those at +1 g and -1 g (eq. 8)."""
    middle: Value = (plus_1g + minus_1g) / 2
    return middle


def sensitivity(output_1: Value, output_2: Value, force_1_g: float = -1.0, force_2_g: float = 1.0) -> Value:
    """Return the output per g from two outputs at two specific forces (eq. 9; eq. 10 at -1 g and +1 g)."""
    per_g: Value = (output_2 - output_1) / (force_2_g - force_1_g)
    return per_g


def squared_magnitude(x_g: float, y_g: float, z_g: float) -> float:
    """Return the squared magnitude of a specific force, g², 1 at rest for a calibrated sensor (eq. 4)."""
    return x_g**2 + y_g**2 + z_g**2
