"""The samples that a model is fitted to: times, specific forces, their noise, and which samples count."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spikes import MIN_SPIKE_SIGMA
from gateway.numerics.stats import normal_quantile, robust_sigma, smallest_steps
from gateway.twin.reconcile.data.swing_amplitude import (
    LARGE_AMPLITUDE_RAD,
    estimate_amplitude_rad,
    has_axial_reading_of_swing,
    make_upright,
)

Array = NDArray[np.float64]
MAX_TEMPERATURE_DEGREE = 6
"""Degree of the polynomial that stands for the temperature."""
SAMPLES_PER_DEGREE = 50
"""Samples that one degree of it needs; more smooth the noise of the thermometer."""


@dataclass(frozen=True)
class Observations:
    """The n samples of a recording. It has no slots, so that properties of the samples can be cached."""

    time_s: Array
    """Since the first sample, increasing, shape (n,)."""
    force_g: Array
    """Specific force in the housing frame, shape (n, 3)."""
    temperature_c: Array | None
    """Smoothed, shape (n,)."""
    noise_g: Array
    """1-sigma per sample and axis, shape (3,)."""
    used: NDArray[np.bool_]
    """False for spikes, which count nowhere, shape (n,)."""
    offset_s: float = 0.0
    """Time of the first sample in the recording of which this is a slice."""

    @cached_property
    def n_values(self) -> int:
        """Number of values that count: one for each sample used and each axis that was measured."""
        return int((~unmeasured_axes(self.force_g)).sum()) * int(self.used.sum())

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def interval_s(self) -> float:
        """Median interval between samples."""
        return float(np.median(np.diff(self.time_s)))

    @cached_property
    def amplitude_rad(self) -> float:
        """Amplitude of the swing at the start of the recording."""
        return estimate_amplitude_rad(self.time_s, make_upright(self.force_g), self.used)

    @cached_property
    def has_large_amplitude(self) -> bool:
        """Whether only the right model follows the swing as one trajectory; never true of a load that bounces."""
        return self.amplitude_rad > LARGE_AMPLITUDE_RAD and has_axial_reading_of_swing(
            self.time_s, make_upright(self.force_g)
        )

    @property
    def per_sigma(self) -> Array:
        """One over the noise, 0 where a sample does not count, shape (n, 3)."""
        weight: Array = self.used[:, None] / self.noise_g
        return weight

    def residual_sigma(self, simulated_g: Array) -> Array:
        """Return (measured - simulated)/noise, 0 where a sample does not count, shape (n, 3)."""
        residual: Array = (self.force_g - simulated_g) / self.noise_g * self.used[:, None]
        return residual

    def chi2(self, simulated_g: Array) -> float:
        """Return the sum of the squared residual in sigma."""
        return float((self.residual_sigma(simulated_g) ** 2).sum())

    def reduced_chi2(self, simulated_g: Array) -> float:
        """Return chi-square per value that counts; 1 is noise alone."""
        return self.chi2(simulated_g) / self.n_values


def unmeasured_axes(force_g: Array) -> NDArray[np.bool_]:
    """Return which axes of readings (n, 3) read zero throughout: a table of two axes has no third, shape (3,)."""
    is_zero = (force_g == 0).all(axis=0)
    unmeasured: NDArray[np.bool_] = is_zero & ~is_zero.all()
    return unmeasured


def slice_samples(observations: Observations, first: int, last: int) -> Observations:
    """Return the samples from `first` to before `last`, with times from the first of them."""
    chosen = slice(first, last)
    temperature_c = observations.temperature_c
    return Observations(
        observations.time_s[chosen] - observations.time_s[first],
        observations.force_g[chosen],
        None if temperature_c is None else temperature_c[chosen],
        observations.noise_g,
        observations.used[chosen],
        observations.offset_s + float(observations.time_s[first]),
    )


def make_observations(time_s: Array, force_g: Array, temperature_c: Array | None, noise_g: Array) -> Observations:
    """Return the observations of increasing, finite samples (n >= 8)."""
    elapsed_s = time_s - time_s[0]
    smoothed_c = None if temperature_c is None else smooth_temperature(elapsed_s, temperature_c)
    return Observations(elapsed_s, force_g, smoothed_c, noise_g, ~detect_spikes(force_g))


def smooth_temperature(time_s: Array, temperature_c: Array) -> Array:
    """Return a polynomial through the temperatures: a housing warms slowly, what is fast is the noise of the thermometer."""
    known = np.isfinite(temperature_c)
    degree = min(MAX_TEMPERATURE_DEGREE, int(known.sum()) // SAMPLES_PER_DEGREE)
    polynomial = np.polynomial.Polynomial.fit(time_s[known], temperature_c[known], degree)
    return np.asarray(polynomial(time_s), dtype=np.float64)


def detect_spikes(force_g: Array) -> NDArray[np.bool_]:
    """Return which samples (n, 3) are far from the mean of their neighbours, shape (n,).

    The first and the last sample are compared with the mean of the four next to them.
    """
    neighbours = np.empty_like(force_g)
    neighbours[1:-1] = (force_g[:-2] + force_g[2:]) / 2
    neighbours[0], neighbours[-1] = force_g[1:5].mean(axis=0), force_g[-5:-1].mean(axis=0)
    distance = np.abs(force_g - neighbours)
    # Quantised or saturated readings mostly equal their neighbours; the median alone would be zero.
    sigma = np.maximum(robust_sigma(distance), np.quantile(distance, 0.98, axis=0) / normal_quantile(0.99)) + 1e-12
    limit = np.maximum(MIN_SPIKE_SIGMA * sigma, 1.5 * smallest_steps(force_g))  # a change by one step is no spike
    spikes: NDArray[np.bool_] = np.any(distance > limit, axis=1)
    spikes[0] = True  # the first sample after a start is often a stale one
    return spikes
