"""Sensor noise from the samples themselves."""

import numpy as np

from gateway.numerics.quantisation import smallest_steps
from gateway.numerics.robust import robust_sigma
from gateway.swing.model.spherical_pendulum import Real

DIFFERENCE_ORDER = 6
"""High enough that a swing of 2 s seen at 10 Hz leaves less than a tenth of a usual noise."""
_GAIN = float(np.sqrt(924.0))  # sum of the squared binomials of order 6
LEAST_SAMPLES = 24
SMALLEST_NOISE_G = 1e-6
NOISIER = 1.1
"""Times the stated noise, from which on what is seen is believed."""


def noise_from_differences(force_g: Real) -> Real | None:
    """Noise per sample and axis, 1 sigma, shape (3,), of evenly spaced samples, shape (n, 3); None with too few.

    Sixth differences leave white noise and nothing of a swing. Their median resists spikes; where quantisation makes most of
    them equal, their rms stands in, and noise is never below that of the smallest step that is seen.
    """
    if len(force_g) < LEAST_SAMPLES:
        return None
    differences = np.diff(force_g, n=DIFFERENCE_ORDER, axis=0) / _GAIN
    noise_g = robust_sigma(differences)
    calm = np.abs(differences) <= 6 * noise_g
    trimmed = np.sqrt((differences**2 * calm).sum(axis=0) / np.maximum(calm.sum(axis=0), 1))
    rms = np.sqrt((differences**2).mean(axis=0))
    found: Real = np.maximum(np.where(noise_g > 0, trimmed, rms), SMALLEST_NOISE_G)
    return found


def believed_noise_g(force_g: Real, stated_g: float | Real | None) -> Real:
    """Noise to reckon with, shape (3,): the larger of what is stated and what is seen, never below quantisation."""
    seen_g = noise_from_differences(force_g)
    floor_g = np.maximum(smallest_steps(force_g) / np.sqrt(12), SMALLEST_NOISE_G)
    noise_g: Real = np.maximum(
        floor_g, 0.0 if stated_g is None else np.broadcast_to(np.asarray(stated_g, dtype=float), 3)
    )
    if seen_g is not None:
        noise_g = np.where(seen_g > NOISIER * noise_g, seen_g, noise_g)
    return noise_g
