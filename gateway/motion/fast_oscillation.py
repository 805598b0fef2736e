"""Detection of an oscillation much faster than the swing: a load that swings under its hook, a rope that vibrates as a string.

A spectral line of the transverse reading, significantly above the spectrum around it.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array

WINDOW_BINS = 192
"""Longest window. Basis: frequency known to a few thousandths after twenty seconds."""
FEWEST_BINS = 48
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


@dataclass(frozen=True, slots=True)
class FastOscillation:
    """A spectral line of the transverse reading."""

    rate_1_s: float
    """Angular frequency."""
    amplitude_g: float
    """Root of the mean square, both axes together."""


class FastOscillationDetector:
    """Keeps the newest bins and looks for a line in them once a second."""

    def __init__(self, bin_s: float, swing_rate_1_s: float) -> None:
        self._bin_s, self._lowest_1_s = bin_s, LOWEST_RATIO * swing_rate_1_s
        self._readings: deque[complex] = deque(maxlen=WINDOW_BINS)
        self._since_check = 0
        self.found: FastOscillation | None = None

    def clear(self) -> None:
        """Forget the bins, as after a gap; the line stays until the next check."""
        self._readings.clear()

    def add(self, force_g: Array) -> bool:
        """Take the reading of a bin, shape (3,); return whether the line was checked."""
        self._readings.append(complex(force_g[0], force_g[1]))
        self._since_check += 1
        if self._since_check < CHECK_EVERY_BINS or len(self._readings) < FEWEST_BINS:
            return False
        self._since_check = 0
        self.found = self._look()
        return True

    def _look(self) -> FastOscillation | None:
        readings = np.array(self._readings)
        n = len(readings) - 2
        curved = np.diff(readings, n=2) * np.hanning(n)  # second differences remove the slow swing
        power = np.abs(np.fft.fft(curved)) ** 2
        half = n // 2
        rate = 2 * np.pi * np.arange(1, half) / (n * self._bin_s)
        gain = (2 * np.sin(rate * self._bin_s / 2)) ** 2
        line_power = (power[1:half] + power[-1:-half:-1]) / gain**2
        allowed = (rate > self._lowest_1_s) & (rate < HIGHEST_SHARE * np.pi / self._bin_s)
        if allowed.sum() < 5:
            return None
        masked = np.where(allowed, line_power, 0.0)
        peak = int(masked.argmax())
        floor = float(np.median(line_power[allowed]))
        is_local = 0 < peak < len(rate) - 1 and line_power[peak] >= max(line_power[peak - 1], line_power[peak + 1])
        needed, smallest_g = (
            (SIGNIFICANCE, SMALLEST_AMPLITUDE_G) if self.found is None else (KEEP_SIGNIFICANCE, KEEP_AMPLITUDE_G)
        )
        amplitude_g = float(2 * np.sqrt(line_power[peak]) / n)
        if not is_local or line_power[peak] < needed * floor or amplitude_g < smallest_g:
            return None
        left, middle, right = np.log(line_power[peak - 1 : peak + 2] + 1e-300)
        shift = 0.5 * (left - right) / (left - 2 * middle + right)
        return FastOscillation(float(rate[peak] + shift * (rate[1] - rate[0])), amplitude_g)
