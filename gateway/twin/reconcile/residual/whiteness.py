"""Is what remains noise? Autocorrelation and lines."""

import math
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.autocorrelation import autocorrelations
from gateway.numerics.spectrum import ZERO_PADDING, periodogram
from gateway.numerics.stats import chi_square_tail
from gateway.twin.reconcile.output.result import Peak, Residual, Spectrum

Array = NDArray[np.float64]
LAGS = 40
MIN_WHITENESS_P = 0.001
PEAK_FALSE_ALARM_RATE = 1e-4
"""Chance, over all bins of all axes, of a peak that noise alone makes."""
FLOOR_BINS = 60
"""Bins on each side that tell the floor under a peak."""
MAX_PEAKS = 6
PLOTTED_BINS = 600


def ljung_box_p(residual: Array) -> float:
    """Smallest over the axes of (n, 3), times three: chance of such an autocorrelation in white noise (Ljung, Box 1978)."""
    found = []
    for axis in residual.T:
        n, lags = len(axis), min(LAGS, len(axis) // 5)
        rho = np.array(list(islice(autocorrelations(axis), lags)))
        if not len(rho):
            continue
        q = n * (n + 2) * float((rho**2 / (n - np.arange(1, lags + 1))).sum())
        found.append(chi_square_tail(q, lags))
    return min(1.0, len(found) * min(found, default=1.0))


def find_peaks(time_s: Array, residual: Array, noise_g: Array) -> tuple[Peak, ...]:
    """Lines of (n, 3) in sigma that stand out of the floor around them, strongest first."""
    frequency_hz, power = periodogram(time_s, residual)
    bins = slice(ZERO_PADDING, None)  # below one turn in the recording there is no line
    found: list[tuple[float, Peak]] = []
    for axis, name in enumerate("xyz"):
        over = power[bins, axis] / noise_floor(power[bins, axis])
        level = math.log(3 * len(over) / ZERO_PADDING / PEAK_FALSE_ALARM_RATE)
        for i in np.flatnonzero(over > level):
            around = over[max(0, i - ZERO_PADDING) : i + ZERO_PADDING + 1]
            if over[i] == around.max():
                amplitude_g = 2 * math.sqrt(power[bins, axis][i] / len(time_s)) * noise_g[axis]
                found.append((float(over[i]), Peak(float(frequency_hz[bins][i]), name, float(amplitude_g))))
    found.sort(key=lambda each: -each[0])
    return tuple(peak for _, peak in found[:MAX_PEAKS])


def noise_floor(power: Array) -> Array:
    """Running median of a power spectrum, as the mean of noise; narrower toward low frequencies, shape (m,)."""
    found = np.empty_like(power)
    reach = FLOOR_BINS * ZERO_PADDING
    for first in range(0, len(power), reach // 4):
        middle = first + reach // 8
        wide = min(reach, max(12 * ZERO_PADDING, middle))
        part = power[max(0, middle - wide) : middle + wide]
        found[first : first + reach // 4] = np.median(part) / math.log(2) + 1e-12
    return found


def analyse_residual(time_s: Array, before: Array, after: Array, noise_g: Array) -> Residual:
    """What a model leaves, (n, 3) in sigma, beside what the one before left."""
    p = ljung_box_p(after)
    return Residual(
        p > MIN_WHITENESS_P, p, find_peaks(time_s, after, noise_g), decimated_spectrum(time_s, before, after)
    )


def decimated_spectrum(time_s: Array, before: Array, after: Array) -> Spectrum:
    """Averaged over bins for a drawing."""
    frequency_hz, power_before = periodogram(time_s, before)
    _, power_after = periodogram(time_s, after)
    edges = np.unique(np.geomspace(ZERO_PADDING, len(frequency_hz), PLOTTED_BINS).astype(int))

    def mean(values: Array) -> Array:
        return np.add.reduceat(values, edges[:-1], axis=0) / np.diff([*edges[:-1], len(values)])[:, None]

    return Spectrum(mean(frequency_hz[:, None])[:, 0], mean(power_before), mean(power_after))
