"""Type A uncertainty of the mean of readings that may hang together in time, and what quantisation adds."""

import numpy as np

from gateway.calibration.poses.pose import Array

SIGNIFICANT = 3.0
"""Standard deviations by which the scatter of window means must exceed that of independent readings to count as correlation."""


def correlation_factor(means: Array, counts: Array, sigma: Array) -> float:
    """By how much correlation widens the uncertainty of the mean: 1 for independent readings (batch means).

    `means` of consecutive windows, shape (k, 3); readings in each, shape (k,); standard deviation of a reading within a
    window, shape (3,). Only a scatter that chance does not explain counts: to take the larger of two estimates each time
    would overstate white noise.
    """
    moving = sigma > 0
    freedom = (len(means) - 1) * int(moving.sum())
    if freedom < 1:
        return 1.0
    weights = counts[:, None]
    centre = (weights * means).sum(axis=0) / weights.sum()
    scatter = (weights * (means - centre) ** 2).sum(axis=0)
    ratio = float((scatter[moving] / sigma[moving] ** 2).sum()) / freedom
    return float(np.sqrt(ratio)) if ratio > 1 + SIGNIFICANT * np.sqrt(2 / freedom) else 1.0


def quantisation_u(step: float, sigma: Array) -> Array:
    """Standard uncertainty of a mean of quantised readings, shape (3,), in the unit of `step`.

    Noise dithers: what is left of the error of a mean is a sine over the step with amplitude step/pi exp(-2 pi^2 (sigma/step)^2)
    (first harmonic of the quantiser); without noise it is that of a rectangular distribution.
    """
    if step <= 0:
        return np.zeros(3)
    dithered = np.exp(-2 * (np.pi * sigma / step) ** 2) / (np.pi * np.sqrt(2))
    return np.asarray(step * np.where(sigma > 0, dithered, 1 / np.sqrt(12)))
