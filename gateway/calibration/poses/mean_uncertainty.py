"""Uncertainty of the mean of readings: correlation in time (type A) and quantisation (type B)."""

import numpy as np

from gateway.numerics.array import Array

K_CORRELATED = 3.0
"""Standard deviations by which the scatter of window means must exceed that of uncorrelated readings, to count as correlation.
Basis: a choice; chance reaches it in 0.1 % of the rests."""


def correlation_factor(means: Array, counts: Array, sigma: Array) -> float:
    """Return the factor by which correlation enlarges the uncertainty of the mean, by batch means; 1 for uncorrelated readings.

    `means` of consecutive windows, shape (k, 3); number of readings in each, shape (k,); standard deviation of a reading
    within a window, shape (3,). The factor is 1 unless the scatter of the means is significant: the larger of the two estimates
    would on average overstate the uncertainty of white noise.
    """
    noisy = sigma > 0
    freedom = (len(means) - 1) * int(noisy.sum())
    if freedom < 1:
        return 1.0
    weights = counts[:, None]
    centre = (weights * means).sum(axis=0) / weights.sum()
    scatter = (weights * (means - centre) ** 2).sum(axis=0)
    ratio = float((scatter[noisy] / sigma[noisy] ** 2).sum()) / freedom
    return float(np.sqrt(ratio)) if ratio > 1 + K_CORRELATED * np.sqrt(2 / freedom) else 1.0


def quantisation_u(step: float, sigma: Array) -> Array:
    """Return the standard uncertainty of a mean of quantised readings, shape (3,), in the unit of `step`.

    Noise of standard deviation sigma dithers the quantiser: the remaining error of a mean is a sine of the value over the step
    with amplitude step/pi exp(-2 pi^2 (sigma/step)^2), its first harmonic. Without noise the error is rectangular.
    """
    if step <= 0:
        return np.zeros(3)
    dithered = np.exp(-2 * (np.pi * sigma / step) ** 2) / (np.pi * np.sqrt(2))
    return np.asarray(step * np.where(sigma > 0, dithered, 1 / np.sqrt(12)))
