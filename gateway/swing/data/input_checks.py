"""Data that no pendulum could have made: named, so that no angle is read from them."""

import numpy as np

from gateway.numerics.saturation import saturation_level
from gateway.swing.model.spherical_pendulum import Real

LARGEST_NORM_ERROR_G = 0.12
"""Of the mean specific force: a swing of 30 degrees moves it by 0.07."""
LARGEST_TILT_RAD = np.pi / 4


def fault_of(force_g: Real) -> str | None:
    """What is wrong with samples of specific force, shape (n, 3), or None."""
    for axis, values in zip("xyz", force_g.T, strict=True):
        end = saturation_level(values)
        if end is not None:
            return f"clipped: {axis} piles up at {end:+.4f} g"
    return fault_of_means(force_g)


def fault_of_means(force_g: Real) -> str | None:
    """The same of samples or means of them, which cannot show clipping."""
    for axis, values in zip("xyz", force_g.T, strict=True):
        if (values == values[0]).all():
            return f"{axis} does not change at all: a dead axis, or steps too coarse for what moves"
    mean_g = force_g.mean(axis=0)
    norm_g = float(np.linalg.norm(mean_g))
    if abs(norm_g - 1.0) > LARGEST_NORM_ERROR_G:
        return f"the mean specific force is {norm_g:.3f} g, not 1: wrong unit or scale"
    if mean_g[2] < norm_g * np.cos(LARGEST_TILT_RAD):
        return f"z reads {mean_g[2]:+.3f} g on the mean: the housing is not upright on the rope"
    return None
