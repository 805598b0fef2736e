"""Checks for data that no pendulum could have produced, so that no angle is read from them."""

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.saturation import saturation_level

MAX_NORM_ERROR_G = 0.12
"""Largest deviation of the mean specific force from 1 g. Basis: a swing of 30 degrees changes the mean by 0.07 g."""
MAX_TILT_RAD = np.pi / 4
"""Largest tilt of the housing against the rope. Basis: a housing clamped to a rope is upright to a few degrees; between this and
90 degrees lies a wrong axes map."""


def find_fault(force_g: Array) -> str | None:
    """Return what is wrong with samples of specific force, shape (n, 3), or None."""
    for axis, values in zip("xyz", force_g.T, strict=True):
        limit_g = saturation_level(values)
        if limit_g is not None:
            return f"clipped: many readings of {axis} are exactly {limit_g:+.4f} g"
    return find_fault_in_means(force_g)


def find_fault_in_means(force_g: Array) -> str | None:
    """Return the same for samples or means of them, which cannot show clipping."""
    return find_constant_axis(force_g) or find_implausible_mean(force_g)


def find_constant_axis(force_g: Array) -> str | None:
    """Return which axis is constant, or None."""
    for axis, values in zip("xyz", force_g.T, strict=True):
        if (values == values[0]).all():
            return f"{axis} does not change at all: the axis is dead, or its steps are too coarse for this motion"
    return None


def find_implausible_mean(force_g: Array) -> str | None:
    """Return what the mean shows of a wrong unit or a wrong axes map, or None."""
    mean_g = force_g.mean(axis=0)
    norm_g = float(np.linalg.norm(mean_g))
    if abs(norm_g - 1.0) > MAX_NORM_ERROR_G:
        return f"the mean specific force is {norm_g:.3f} g, not 1 g: wrong unit or scale"
    if mean_g[2] < norm_g * np.cos(MAX_TILT_RAD):
        return f"the mean of z is {mean_g[2]:+.3f} g: the housing is not upright on the rope"
    return None
