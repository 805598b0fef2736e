"""Periodograms of residuals: lines and where they stand."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

MIN_MACHINE_LINE_HZ = 3.0
"""Below, what shakes the housing may as well come down the rope from a moving pivot. Basis: a choice; below, what shakes the
housing may as well come down the rope from a moving pivot."""
LINE_SEARCH_HZ = 1.0
"""Width of the band around a line whose median is the floor. Basis: a choice; many bins at recordings of some ten seconds, and no
slope of the spectrum."""
MIN_LINE_RATIO = 20.0
"""Over the median around it, summed over three axes: noise alone gets there once in 10^18 bins. Basis: noise alone gets there
once in 10^18 bins."""
ZERO_PADDING = 4
"""Zero padding. Basis: a line between two bins loses at most 2 % of its power."""


@dataclass(frozen=True, slots=True)
class SpectralLine:
    """A narrow line."""

    frequency_hz: float
    power: Array
    """Of each axis over the noise floor's mean around it, shape (3,)."""
    total: float
    """Sum over the axes of power over floor."""


@dataclass(frozen=True, slots=True)
class MachineLine:
    """What a machine shakes the housing with."""

    frequency_hz: float
    phasors_g: NDArray[np.complex128]
    """c of Re(c exp(2 pi i f t)), shape (3,)."""


def find_machine_line(time_s: Array, residual_g: Array, noise_g: Array) -> MachineLine | None:
    """The strongest line above the swings in (n, 3), at times that need not be even; None where none stands out."""
    highest_hz = 0.49 / float(np.median(np.diff(time_s)))
    residual = residual_g / noise_g
    rough = find_strongest_line(time_s, residual, MIN_MACHINE_LINE_HZ, highest_hz)
    if rough is None:
        return None
    steps_hz = np.arange(-LINE_SEARCH_HZ, LINE_SEARCH_HZ, 0.25 / (time_s[-1] - time_s[0]))
    tried_hz = rough.frequency_hz + steps_hz
    tried_hz = tried_hz[tried_hz > MIN_MACHINE_LINE_HZ]
    turning = np.exp(-2j * np.pi * tried_hz[0] * time_s)
    turn = np.exp(-2j * np.pi * (steps_hz[1] - steps_hz[0]) * time_s)
    power = np.empty(len(tried_hz))
    for i in range(len(tried_hz)):
        power[i] = (np.abs(turning @ residual) ** 2).sum()
        turning = turning * turn
    if power.max() < MIN_LINE_RATIO * np.median(power):
        return None
    line_hz = refine_frequency(time_s, residual, float(tried_hz[int(np.argmax(power))]))
    if power.argmax() == 0 or line_hz < MIN_MACHINE_LINE_HZ:
        return None  # the flank of something slower
    return MachineLine(line_hz, fit_sine_phasors(time_s, residual_g, line_hz))


def periodogram(time_s: Array, residual: Array) -> tuple[Array, Array]:
    """Frequencies (m,) and power (m, 3) scaled so that white noise of unit variance has mean 1."""
    rate_hz = (len(time_s) - 1) / (time_s[-1] - time_s[0])
    count = ZERO_PADDING * len(time_s)
    transform = np.fft.rfft(residual - residual.mean(axis=0), count, axis=0)
    frequency_hz = np.fft.rfftfreq(count, 1 / rate_hz)
    return frequency_hz, np.abs(transform) ** 2 / len(time_s)


def find_strongest_line(time_s: Array, residual: Array, from_hz: float, to_hz: float) -> SpectralLine | None:
    """The line that stands out most from the floor of its own axis in a band."""
    frequency_hz, power = periodogram(time_s, residual)
    band = (frequency_hz >= from_hz) & (frequency_hz <= to_hz)
    if band.sum() < 8 * ZERO_PADDING:
        return None
    floor = np.median(power[band], axis=0) / np.log(2) + 1e-12
    over = power[band] / floor
    best = int(np.argmax(over.sum(axis=1)))
    return SpectralLine(float(frequency_hz[band][best]), over[best], float(over[best].sum()))


def fit_sine_phasors(time_s: Array, values: Array, frequency_hz: float) -> NDArray[np.complex128]:
    """c of Re(c exp(2 pi i f t)) by least squares, one for each column."""
    angle = 2 * np.pi * frequency_hz * time_s
    design = np.stack([np.cos(angle), -np.sin(angle), np.ones_like(angle)], axis=1)
    solved = np.linalg.lstsq(design, values, rcond=None)[0]
    found: NDArray[np.complex128] = solved[0] + 1j * solved[1]
    return found


def refine_frequency(time_s: Array, values: Array, frequency_hz: float) -> float:
    """Frequency of the best-fitting sine near one, from the phase's drift between quarters of the recording."""
    for parts in (4, 8):
        edges = np.linspace(0, len(time_s), parts + 1).astype(int)
        phasors = [fit_sine_phasors(time_s[a:b], values[a:b], frequency_hz) for a, b in pairwise(edges)]
        turns = sum((np.conj(p) * q).sum() for p, q in pairwise(phasors))
        frequency_hz += float(np.angle(turns)) / (2 * np.pi * (time_s[-1] - time_s[0]) / parts)
    return frequency_hz
