"""Checks for data that no pendulum could have produced, so that no angle is read from them."""

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.saturation import saturation_level

MAX_NORM_ERROR_G = 0.12
"""Largest deviation of the mean specific force from what a swing permits. Basis: an elliptical swing of 25 degrees, seen from the
load, adds 0.1 g."""
AXIAL_QUANTILE = 0.005
"""Quantile of the axial reading that stands for its value at the turning points, without the outliers of the noise."""
LEAST_MEAN_G = 0.33
"""Least mean over a part of a recording that contains gravity. Basis: 0.457 g over a swing of 90 degrees at the pivot; readings
without gravity have 2 rho (mean cos - cos A) at most, less than 0.3 g below 45 degrees."""
PARTS, FEWEST_SAMPLES = 4, 24
"""Parts of a recording whose means are judged, and fewest samples of one."""
MAX_TILT_RAD = np.pi / 4
"""Largest tilt of the housing against the rope. Basis: a housing clamped to a rope is upright to a few degrees; between this and
90 degrees lies a wrong axes map."""


WITHOUT_GRAVITY = "gravity is missing: far below 1 g; export the acceleration with gravity, of a sensor that hangs"


def find_fault(force_g: Array, axes: str = "xyz") -> str | None:
    """Return what is wrong with samples of specific force, shape (n, 3), or None; `axes`: those that were recorded."""
    for axis, values in zip("xyz", force_g.T, strict=True):
        limit_g = saturation_level(values) if axis in axes else None
        if limit_g is not None:
            return f"clipped: many readings of {axis} are exactly {limit_g:+.4f} g"
    return find_constant_axis(force_g, axes) or find_implausible_mean(force_g)


def find_fault_in_means(force_g: Array) -> str | None:
    """Return the same for samples or means of them, which cannot show clipping."""
    return find_constant_axis(force_g) or find_implausible_mean(force_g)


def find_constant_axis(force_g: Array, axes: str = "xyz") -> str | None:
    """Return which of some axes is constant, or None."""
    for axis, values in zip("xyz", force_g.T, strict=True):
        if axis in axes and (values == values[0]).all():
            return f"{axis} does not change at all: the axis is dead, or its steps are too coarse for this motion"
    return None


def find_implausible_mean(force_g: Array) -> str | None:
    """Return what the mean shows of a wrong unit or a wrong axes map, or None.

    A swing of amplitude A at rho has the mean (1 + 2 rho) m - 2 rho cos A, where m is the mean of cos(theta), and reads cos A at
    its turning points. With d the relative depth of that minimum below the mean, the mean is 1 - d for rho 0 and 1 + d/3 for
    rho 1 in a small swing, and between these, to a few per cent, in any up to 90 degrees.
    """
    mean_g = force_g.mean(axis=0)
    norm_g = float(np.linalg.norm(mean_g))
    if lacks_gravity(force_g):
        return WITHOUT_GRAVITY
    axial = force_g @ mean_g / norm_g**2
    depth = float(np.clip(1.0 - np.quantile(axial, AXIAL_QUANTILE), 0.0, 1.0))
    if not 1.0 - depth - MAX_NORM_ERROR_G < norm_g < 1.0 + depth / 3 + MAX_NORM_ERROR_G:
        return f"the mean specific force is {norm_g:.3f} g, not 1 g: wrong unit or scale"
    if mean_g[2] < norm_g * np.cos(MAX_TILT_RAD):
        return f"the mean of z is {mean_g[2]:+.3f} g: the housing is not upright on the rope; state its axes (--axes)"
    return None


def lacks_gravity(force_g: Array) -> bool:
    """Return whether the readings (n, 3) in g contain no gravity: the mean of some part of them is far below 1 g."""
    parts = np.array_split(force_g, max(1, min(PARTS, len(force_g) // FEWEST_SAMPLES)))
    return min(float(np.linalg.norm(part.mean(axis=0))) for part in parts) < LEAST_MEAN_G
