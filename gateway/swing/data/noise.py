"""The sensor's noise, measured from the samples themselves."""

from math import comb

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.stats import robust_sigma, smallest_steps

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
