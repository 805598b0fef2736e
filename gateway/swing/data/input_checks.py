"""Checks for data that no pendulum could have produced, so that no angle is read from them."""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.foreign_readings import saturation_level

MAX_NORM_ERROR_G = 0.12
"""Largest deviation of the mean specific force from what a swing permits. Basis: an elliptical swing of 25 degrees, seen from the
load, adds 0.1 g."""
AXIAL_QUANTILE = 0.005
"""Quantile of the axial reading that stands for its value at the turning points, without the outliers of the noise."""
MIN_MEAN_G = 0.33
"""Least mean over a part of a recording that contains gravity, unless the size says otherwise. Basis: 0.457 g over a swing of
90 degrees at the pivot; readings without gravity have 2 rho (mean cos - cos A) at most, less than 0.3 g below 45 degrees."""
MIN_RMS_G, MIN_SIZE_G, SIZE_QUANTILE = 0.8, 0.4, 0.05
"""Least rms, and least quantile, of the size of readings with gravity and a smaller mean. Basis: in planar swings of up to 160
degrees at any rho with such a mean, the rms is at least 1.0 g and the quantile 0.45 g; without gravity the rms is at most 0.66 g,
and the readings of what is shaken pass through zero."""
JUDGED_PARTS, MIN_PART_SAMPLES = 4, 24
"""Parts of a recording whose means are judged, and fewest samples of one."""
MAX_TILT_RAD = np.pi / 4
"""Largest tilt of the housing against the rope. Basis: a housing clamped to a rope is upright to a few degrees; between this and
90 degrees lies a wrong axes map."""


MAX_CLIPPED_SHARE = 0.4
"""Part of the axial readings at the upper end of the range, up to which they are left out. Basis: a sensor of 2 g near the load
reads more for 0.37 to 0.39 of the time in swings of 90 to 110 degrees, about the lowest point."""


WITHOUT_GRAVITY = "gravity is missing: far below 1 g; export the acceleration with gravity, of a sensor that hangs"


def axially_clipped(force_g: Array) -> NDArray[np.bool_]:
    """Return which samples (n, 3) are clipped at the upper end of z, shape (n,), where they can be spared; else none.

    The load is then near its lowest point: the turning points, which state the largest angle, are among the others.
    """
    limit_g = saturation_level(force_g[:, 2])
    clipped = np.zeros(len(force_g), dtype=np.bool_)
    if limit_g is not None and limit_g > 1.0:
        at_limit: NDArray[np.bool_] = force_g[:, 2] >= limit_g
        return at_limit if at_limit.mean() <= MAX_CLIPPED_SHARE else clipped
    return clipped


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
    """Return whether the readings (n, 3) in g contain no gravity: some part of them is far below 1 g, in the mean and in size."""
    parts = np.array_split(force_g, max(1, min(JUDGED_PARTS, len(force_g) // MIN_PART_SAMPLES)))
    return any(float(np.linalg.norm(part.mean(axis=0))) < MIN_MEAN_G and _is_small(part) for part in parts)


def _is_small(force_g: Array) -> bool:
    size_g = np.linalg.norm(force_g, axis=1)
    return float(np.sqrt((size_g**2).mean())) < MIN_RMS_G or float(np.quantile(size_g, SIZE_QUANTILE)) < MIN_SIZE_G
