"""Effects that are not in the readings' mean: seen in the values themselves, before any model is fitted."""

import math

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.data.observations import Observations

Array = NDArray[np.float64]
MIN_SATURATED_SHARE = 0.004
"""Part of an axis' readings that stand exactly at its extreme: noise puts one there, a limit many."""
WRITTEN_RESOLUTION_G = 1e-6
"""Readings that differ by less are the same, g: recordings are written with six or seven digits."""
MIN_STEP_SIGMA = 1.0
"""A step this many noise sigmas wide shows in the residual: its error has a variance of q^2/12."""
MIN_ON_LATTICE_SHARE = 0.98


def detect_saturation(force_g: Array) -> float | None:
    """The level at which readings (n, 3) stop, g; None where they do not."""
    found = []
    for axis in force_g.T:
        for signed in (axis, -axis):
            top = float(signed.max())
            if top > 0 and np.mean(signed > top - WRITTEN_RESOLUTION_G) > MIN_SATURATED_SHARE:
                found.append(top)
    return max(found, default=None)


def detect_quantisation_step(force_g: Array, noise_g: Array) -> float | None:
    """The step q of readings (n, 3) that are all multiples of one, g; None where it is finer than the noise shows.

    Believed only where far fewer values occur than readings of this spread would have, and all stand on the lattice.
    """
    gaps = []
    for axis in force_g.T:
        values = np.unique(np.round(axis / WRITTEN_RESOLUTION_G) * WRITTEN_RESOLUTION_G)
        if len(values) > 1:
            gaps.append(np.diff(values))
    if not gaps:
        return None
    every = np.concatenate(gaps)
    # Written with six or seven digits, a step shows with that rounding: the smallest gaps, averaged.
    step = (
        float(np.median(every[every < 1.5 * every[every > 2 * WRITTEN_RESOLUTION_G].min(initial=np.inf)]))
        if len(every)
        else 0.0
    )
    if not math.isfinite(step) or step < MIN_STEP_SIGMA * float(np.min(noise_g)):
        return None
    step = _refine_step(step, force_g)
    away = np.abs(force_g / step - np.round(force_g / step)) * step
    return step if np.mean(away < 5 * WRITTEN_RESOLUTION_G) > MIN_ON_LATTICE_SHARE else None


def _refine_step(step: float, force_g: Array) -> float:
    """The step from all readings, small multiples first, so that no multiple is miscounted."""
    for most in (4, 16, 64, 256, 1024, 8192):
        times = np.round(force_g / step)
        inside = (np.abs(times) <= most) & (times != 0)
        if inside.any():
            step = float((force_g[inside] * times[inside]).sum() / (times[inside] ** 2).sum())
    return step


def noise_with_quantisation_g(observations: Observations, step_g: float) -> Array:
    """Noise with the step's error in it, shape (3,)."""
    found: Array = np.sqrt(observations.noise_g**2 + step_g**2 / 12)
    return found


def quantised_mean(force_g: Array, step_g: float, noise_g: Array) -> Array:
    """What readings in steps are on average when noise comes before the step, shape (n, 3)."""
    erf = np.vectorize(math.erf, otypes=[np.float64])
    nearest = np.round(force_g / step_g)
    found = (nearest + 2.5) * step_g
    for edge in (-1.5, -0.5, 0.5, 1.5):
        found = found - step_g * 0.5 * (1 + erf(((nearest + edge) * step_g - force_g) / (noise_g * math.sqrt(2))))
    return found - step_g * 0.5


def step_values(step_g: float) -> dict[str, Value]:
    """Of the effect."""
    return {"lsb_g": step_g}
