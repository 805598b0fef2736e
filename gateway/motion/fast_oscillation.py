"""Detection of an oscillation much faster than the swing: a load that swings under its hook, a rope that vibrates as a string.

A spectral line of the transverse reading, significantly above the spectrum around it.
"""

from collections import deque
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

WINDOWS_BINS = (192, 64)
"""Windows that are searched in turn. Basis: the longer one knows a frequency to a few thousandths; an oscillation that has just
begun (a hook that slings jerk, a rope that a brake plucks) shows in the shorter one ten seconds earlier. With the longer one
alone, half as many trips again are without cause on simulated cranes."""
RATE_U = 0.5
"""Standard uncertainty of a line's frequency, in steps of the spectrum."""
CHECK_EVERY_BINS = 10
LOWEST_RATIO = 3.5
"""Lowest frequency over that of the swing. Basis: a wide free swing has a third harmonic; second modes of loads under hooks lie
above it."""
HIGHEST_SHARE = 0.9
"""Highest frequency over half the rate of the bins."""
SIGNIFICANCE = 25.0
"""Power of a line over the median of the spectrum. Basis: chance exceeds it once in 1e6 spectra of 100 frequencies."""
KEEP_SIGNIFICANCE = 8.0
"""The same for a line that is already known."""
SMALLEST_AMPLITUDE_G, KEEP_AMPLITUDE_G = 3e-4, 1.5e-4
"""Amplitude from which on a line counts, and while it is known. Basis: at four times the swing's frequency it changes the rope's
angle by less than 0.01 degrees; the bins' noise covers it."""
FEWEST_FREQUENCIES = 5
"""Below this a spectrum has no floor to compare a line with."""


@dataclass(frozen=True, slots=True)
class FastOscillation:
    """A spectral line of the transverse reading."""

    rate_1_s: float
    """Angular frequency."""
    amplitude_g: float
    """Root of the mean square, both axes together."""
    rate_u_1_s: float
    """Standard uncertainty of the angular frequency."""


class FastOscillationDetector:
    """Keeps the newest bins and looks for a line in them once a second."""

    def __init__(self, bin_s: float, swing_rate_1_s: float) -> None:
        self._bin_s, self._lowest_1_s = bin_s, LOWEST_RATIO * swing_rate_1_s
        self._readings: deque[complex] = deque(maxlen=max(WINDOWS_BINS))
        self._since_check = 0
        self.found: FastOscillation | None = None

    def clear(self) -> None:
        """Forget the bins, as after a gap; the line stays until the next check."""
        self._readings.clear()

    def add(self, force_g: Array) -> bool:
        """Take the reading of a bin, shape (3,); return whether the line was checked."""
        self._readings.append(complex(force_g[0], force_g[1]))
        self._since_check += 1
        if self._since_check < CHECK_EVERY_BINS or len(self._readings) < min(WINDOWS_BINS):
            return False
        self._since_check = 0
        self.found = self._look()
        return True

    def _look(self) -> FastOscillation | None:
        readings = np.array(self._readings)
        spectra = [
            _Spectrum.of(readings[-bins:], self._bin_s, self._lowest_1_s)
            for bins in WINDOWS_BINS
            if len(readings) >= bins
        ]
        is_new = self.found is None
        needed = SIGNIFICANCE if is_new else KEEP_SIGNIFICANCE
        lines = [(rate, one) for one in spectra if (rate := one.line_1_s(needed)) is not None]
        if not lines:
            return None
        rate_1_s, spectrum = lines[0]
        amplitude_g = max(one.amplitude_g(rate_1_s) for one in spectra)
        if amplitude_g < (SMALLEST_AMPLITUDE_G if is_new else KEEP_AMPLITUDE_G):
            return None
        return FastOscillation(rate_1_s, amplitude_g, RATE_U * float(spectrum.rate_1_s[0]))


@dataclass(frozen=True, slots=True)
class _Spectrum:
    """Power of the transverse reading, both senses of rotation together."""

    rate_1_s: Array
    """Multiples of the first one."""
    power: Array
    allowed: NDArray[np.bool_]
    """Where a line may be."""
    bins: int

    @classmethod
    def of(cls, readings: NDArray[np.complex128], bin_s: float, lowest_1_s: float) -> Self:
        """Return the spectrum of the readings of bins; a line may be above a frequency."""
        n = len(readings) - 2
        curved = np.diff(readings, n=2) * np.hanning(n)  # second differences remove the slow swing
        power = np.abs(np.fft.fft(curved)) ** 2
        half = n // 2
        rate: Array = 2 * np.pi / (n * bin_s) * np.arange(1, half, dtype=np.float64)
        gain = (2 * np.sin(rate * bin_s / 2)) ** 2
        line_power = (power[1:half] + power[-1:-half:-1]) / gain**2
        return cls(rate, line_power, (rate > lowest_1_s) & (rate < HIGHEST_SHARE * np.pi / bin_s), n)

    def line_1_s(self, needed: float) -> float | None:
        """Return the angular frequency of the highest line; None where none is so much above the median."""
        if self.allowed.sum() < FEWEST_FREQUENCIES:
            return None
        peak = int(np.where(self.allowed, self.power, 0.0).argmax())
        around = self.power[max(peak - 1, 0) : peak + 2]
        if len(around) < 3 or around.max() > self.power[peak]:
            return None
        if self.power[peak] < needed * np.median(self.power[self.allowed]):
            return None
        left, middle, right = np.log(around + 1e-300)
        shift = 0.5 * (left - right) / (left - 2 * middle + right)
        return float(self.rate_1_s[peak] + shift * self.rate_1_s[0])

    def amplitude_g(self, rate_1_s: float) -> float:
        """Return the amplitude of the line next to a frequency."""
        nearest = round(rate_1_s / float(self.rate_1_s[0])) - 1
        return float(2 * np.sqrt(self.power[max(nearest - 1, 0) : nearest + 2].max()) / self.bins)
