"""Checks of the samples before a fit: data that no pendulum could have produced, from which no angle is read, and their noise."""

from math import comb

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.foreign_readings import saturation_level
from gateway.numerics.stats import robust_sigma, smallest_steps

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


UPRIGHT_AXES = {
    ("x", True): "y,z,x",
    ("x", False): "z,y,-x",
    ("y", True): "x,-z,y",
    ("y", False): "x,z,-y",
    ("z", False): "x,-y,-z",
}
"""Definition: the right-handed axes whose z is the one that reads +1 g (True) or -1 g."""


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
        return f"the mean of z is {mean_g[2]:+z.3f} g: the housing is not upright on the rope; {_axes_remedy(mean_g)}"
    return None


def _axes_remedy(mean_g: Array) -> str:
    """Return which axes to state, where one of those that were read carries most of the weight."""
    up = int(np.abs(mean_g).argmax())
    if abs(mean_g[up]) < np.linalg.norm(mean_g) * np.cos(MAX_TILT_RAD):
        return "state its axes (--axes)"
    axes = UPRIGHT_AXES["xyz"[up], bool(mean_g[up] > 0)]
    return f"{'xyz'[up]} carries {mean_g[up]:+.3f} g: state its axes, of those as they are read now --axes {axes}"


def lacks_gravity(force_g: Array) -> bool:
    """Return whether the readings (n, 3) in g contain no gravity: some part of them is far below 1 g, in the mean and in size."""
    parts = np.array_split(force_g, max(1, min(JUDGED_PARTS, len(force_g) // MIN_PART_SAMPLES)))
    return any(float(np.linalg.norm(part.mean(axis=0))) < MIN_MEAN_G and _is_small(part) for part in parts)


def _is_small(force_g: Array) -> bool:
    size_g = np.linalg.norm(force_g, axis=1)
    return float(np.sqrt((size_g**2).mean())) < MIN_RMS_G or float(np.quantile(size_g, SIZE_QUANTILE)) < MIN_SIZE_G


DIFFERENCE_ORDER = 6
"""Order of the differences that remove a swing. Basis: a swing of 2 s sampled at 10 Hz leaves less than a tenth of a common
noise."""
DIFFERENCE_GAIN = float(np.sqrt(comb(2 * DIFFERENCE_ORDER, DIFFERENCE_ORDER)))
"""Definition: standard deviation of a difference over that of a sample, the root of the sum of the squared binomials."""
MIN_NOISE_SAMPLES = 24
"""Fewest samples from which noise is measured. Basis: 18 differences, whose standard deviation is known to 20 %."""
OUTLIER_SIGMA = 6.0
"""Differences beyond this are left out. Basis: noise exceeds it once in 5e8 samples."""
MIN_NOISE_G = 1e-6
"""Smallest noise. Basis: resolution of recordings with six digits; it keeps weights finite for simulated data without noise."""
MIN_NOISE_RATIO = 1.1
"""Measured over stated noise from which on the measured one is used. Basis: two standard deviations of a noise measured from
256 samples."""


def measured_noise_g(force_g: Array) -> Array | None:
    """Return the noise per sample and axis, 1 sigma, shape (3,), of evenly spaced samples (n, 3); None with too few samples.

    Sixth differences contain the white noise and nothing of a swing. Their median resists spikes. Where quantisation makes most
    of them equal, their rms is used instead.
    """
    if len(force_g) < MIN_NOISE_SAMPLES:
        return None
    differences = np.diff(force_g, n=DIFFERENCE_ORDER, axis=0) / DIFFERENCE_GAIN
    noise_g = robust_sigma(differences)
    kept = np.abs(differences) <= OUTLIER_SIGMA * noise_g
    trimmed = np.sqrt((differences**2 * kept).sum(axis=0) / np.maximum(kept.sum(axis=0), 1))
    rms = np.sqrt((differences**2).mean(axis=0))
    found: Array = np.maximum(np.where(noise_g > 0, trimmed, rms), MIN_NOISE_G)
    return found


def effective_noise_g(force_g: Array, stated_g: float | Array | None) -> Array:
    """Return the noise for the weights of a fit, shape (3,): the larger of stated and measured, never below quantisation."""
    measured_g = measured_noise_g(force_g)
    floor_g = np.maximum(smallest_steps(force_g) / np.sqrt(12), MIN_NOISE_G)
    noise_g: Array = np.maximum(
        floor_g, 0.0 if stated_g is None else np.broadcast_to(np.asarray(stated_g, dtype=float), 3)
    )
    if measured_g is not None:
        noise_g = np.where(measured_g > MIN_NOISE_RATIO * noise_g, measured_g, noise_g)
    return noise_g


def shared_quantisation(time_s: Array, force_g: Array, noise_g: Array, span_s: float) -> float:
    """Return the quantisation error that all samples within a span share, over the noise of a sample: the largest of the axes.

    A mean does not make it smaller. Noise of standard deviation sigma dithers steps of q: the error's first harmonic falls by
    exp(-2 (pi sigma/q)^2), the characteristic function of the noise at 1/q. A signal that crosses many
    steps within the span makes it another each time.
    """
    step_g = np.maximum(smallest_steps(force_g), MIN_NOISE_G)
    dither = np.maximum(noise_g**2 - step_g**2 / 12, 0.0) / step_g**2
    shared_g = step_g / np.sqrt(12) * np.exp(-2 * np.pi**2 * dither)
    spans = max(float(time_s[-1] - time_s[0]) / span_s, 1.0)
    travel_g = np.maximum(np.abs(np.diff(force_g, axis=0)).sum(axis=0) / spans - noise_g * len(force_g) / spans, 0.0)
    return float((shared_g / noise_g / np.sqrt(1 + travel_g / step_g)).max())
