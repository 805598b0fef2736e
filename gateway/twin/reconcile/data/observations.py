"""A recording as the reconciliation takes it: times that rise, forces in g, noise, and which samples count."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.robust import robust_sigma
from gateway.twin.reconcile.data.swing_amplitude import (
    LARGE_AMPLITUDE_RAD,
    estimate_amplitude_rad,
    has_swing_at_half_axial_frequency,
)

Array = NDArray[np.float64]
SPIKE_SIGMA = 8.0
"""A lone sample further from its neighbours' line than this, in robust spreads of that distance, is no motion of a load."""
TEMPERATURE_DEGREE = 6


@dataclass(frozen=True)
class Observations:
    """What was measured, n samples. Without slots: properties of the samples are computed once."""

    time_s: Array
    """Since the first sample, rising, shape (n,)."""
    force_g: Array
    """Specific force in the housing frame, shape (n, 3)."""
    temperature_c: Array | None
    """Smoothed, shape (n,)."""
    noise_g: Array
    """1-sigma per sample and axis, shape (3,)."""
    used: NDArray[np.bool_]
    """False for lone spikes, shape (n,): they count nowhere."""
    offset_s: float = 0.0
    """Of the recording that it is a piece of, since that one's first sample."""

    @property
    def n_values(self) -> int:
        """Numbers that count: three for each sample used."""
        return 3 * int(self.used.sum())

    @property
    def duration_s(self) -> float:
        """From first to last sample."""
        return float(self.time_s[-1] - self.time_s[0])

    @cached_property
    def amplitude_rad(self) -> float:
        """The swing's amplitude at the start."""
        return estimate_amplitude_rad(self.time_s, self.force_g, self.used)

    @cached_property
    def has_large_amplitude(self) -> bool:
        """Whether only the right model follows the swing as one trajectory; never true of a load that bounces."""
        return self.amplitude_rad > LARGE_AMPLITUDE_RAD and has_swing_at_half_axial_frequency(self.time_s, self.force_g)

    def residual_sigma(self, simulated_g: Array) -> Array:
        """(measured - simulated)/noise, 0 where a sample does not count, shape (n, 3)."""
        found: Array = (self.force_g - simulated_g) / self.noise_g * self.used[:, None]
        return found

    def chi2(self, simulated_g: Array) -> float:
        """Return the sum of the squared residual in sigma."""
        return float((self.residual_sigma(simulated_g) ** 2).sum())

    def reduced_chi2(self, simulated_g: Array) -> float:
        """Return chi-square per number that counts; 1 is noise alone."""
        return self.chi2(simulated_g) / self.n_values


@dataclass(frozen=True, slots=True)
class Recordings:
    """What is fitted and what is judged on."""

    log: Observations
    held_out: Observations
    """At true times, where samples were lost."""
    held_out_as_stamped: Observations
    last_third: bool


def slice_samples(observations: Observations, first: int, last: int) -> Observations:
    """Samples first to last - 1."""
    chosen = slice(first, last)
    warm = observations.temperature_c
    return Observations(
        observations.time_s[chosen] - observations.time_s[first],
        observations.force_g[chosen],
        None if warm is None else warm[chosen],
        observations.noise_g,
        observations.used[chosen],
        observations.offset_s + float(observations.time_s[first]),
    )


def make_observations(time_s: Array, force_g: Array, temperature_c: Array | None, noise_g: Array) -> Observations:
    """Observations of rising, finite samples (n >= 8)."""
    elapsed = time_s - time_s[0]
    warm = None if temperature_c is None else fit_temperature(elapsed, temperature_c)
    return Observations(elapsed, force_g, warm, noise_g, ~detect_spikes(force_g))


def fit_temperature(time_s: Array, temperature_c: Array) -> Array:
    """A polynomial: a sensor's case warms slowly, what is quick is the thermometer's noise."""
    known = np.isfinite(temperature_c)
    degree = min(TEMPERATURE_DEGREE, int(known.sum()) // 50)
    fitted = np.polynomial.Polynomial.fit(time_s[known], temperature_c[known], degree)
    return np.asarray(fitted(time_s), dtype=np.float64)


def detect_spikes(force_g: Array) -> NDArray[np.bool_]:
    """Samples that stand alone: far from the median of their neighbours, shape (n,).

    The first and the last have neighbours on one side only: a line through four of them is carried on.
    """
    around = np.empty_like(force_g)
    around[1:-1] = (force_g[:-2] + force_g[2:]) / 2
    around[0], around[-1] = force_g[1:5].mean(axis=0), force_g[-5:-1].mean(axis=0)
    away = np.abs(force_g - around)
    # Median and a high quantile: on a lattice or at a limit most neighbours agree exactly.
    spread = np.maximum(robust_sigma(away), np.quantile(away, 0.98, axis=0) / 2.33) + 1e-12
    found: NDArray[np.bool_] = np.any(away > SPIKE_SIGMA * spread, axis=1)
    found[0] = True  # the first sample after a start is often a stale one
    return found
