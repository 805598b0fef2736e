"""Free swings and rests in a stream of readings, each reduced to the harmonics of some periods.

Weeks of recordings become a few numbers for each window of `WINDOW_PERIODS` periods in which nothing but the rope moves the
load.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.stats import means_by_group
from gateway.swing.data.input_checks import effective_noise_g
from gateway.swing.model.sensor_lowpass import spread_s
from gateway.swing.rig import MountedHousing

WINDOW_PERIODS = 6.0
"""Length of a window in periods of a small swing. Basis: a choice; amplitude and period are distinct in it, and a crane leaves
its load alone for as long."""
BINS_PER_PERIOD = 48
"""Basis: a choice; a bin attenuates the fourth harmonic by 1 %, which is corrected."""
PERIOD_RATIOS = (0.6, 1.6)
"""Range of the period over that of the nominal rope. Basis: a rope of 0.36 to 2.6 times the stated length."""
REST_RAD, LEAST_SWING_RAD, LARGEST_SWING_RAD = 0.002, 0.012, 0.25
"""Amplitude up to which a load rests, and those of a swing that is used. Basis: a rest of 2 mrad reads 2 µg less along the rope;
a swing of 12 mrad has 100 µg at twice its frequency; a wider one than 14 degrees is rare and its drag is not."""
NOISE_RATIO, SWING_RATIO = 2.5, 0.02
"""Residual of a free motion over the noise, and over the amplitude. Basis: noise alone stays below 1.3 times itself; a trolley, a
hand or a second body leave some per cent."""
MAX_GROWTH, MAX_PHASE_RAD = 0.03, 0.03
"""Growth of a free swing within a window, and curvature of its phase. Basis: nothing drives a free swing; a hoist that changes
the rope by 1.5 % within a window curves the phase by so much."""


@dataclass(frozen=True, slots=True)
class FreeWindow:
    """A window of a free swing or of a rest. Polynomials are in the place in the window, -1 to 1."""

    middle_s: float
    half_s: float
    rate_1_s: float
    """Angular frequency of the swing; of a rest that of the nominal rope."""
    mean_g: Array
    """Mean reading as a polynomial of second order, shape (3, 3): order, axis."""
    waves_g: NDArray[np.complex128]
    """Harmonics 1 to 4 as polynomials of second order, shape (4, 3, 3): harmonic, order, axis; 3 and 4 are constant."""
    noise_g: float
    """Standard deviation of the mean of the axis along the rope by white noise."""
    spread_s2: float
    """Variance of the time over which a value was averaged, by bins and the sensor's low-pass."""
    is_swing: bool


class FreeMotionFinder:
    """Finds windows of free swings and rests; it holds the readings of one window, whatever the length of the stream."""

    def __init__(self, housing: MountedHousing) -> None:
        self._housing = housing
        self._period_s = housing.small_swing_period_s
        self._time_s, self._force_g = np.empty(0), np.empty((0, 3))
        self._lever = 1 - housing.rho_at(housing.length_m)

    def feed(self, time_s: Array, force_g: Array) -> list[FreeWindow]:
        """Take readings, shapes (n,) and (n, 3), a clipped one being NaN; return the windows that they complete."""
        self._time_s = np.concatenate([self._time_s, time_s])
        self._force_g = np.concatenate([self._force_g, force_g])
        found, window_s = [], WINDOW_PERIODS * self._period_s
        start = 0
        while len(self._time_s) > start and self._time_s[-1] - self._time_s[start] >= window_s:
            stop = int(np.searchsorted(self._time_s, self._time_s[start] + window_s))
            window = self._judge(self._time_s[start:stop], self._force_g[start:stop])
            if window is not None:
                found.append(window)
            step_s = window_s / (1 if window is not None else 4)
            start = max(start + 1, int(np.searchsorted(self._time_s, self._time_s[start] + step_s)))
        self._time_s, self._force_g = self._time_s[start:], self._force_g[start:]
        return found

    def _judge(self, time_s: Array, force_g: Array) -> FreeWindow | None:
        """Return the window of one motion, None where something else than the rope moved it, or readings are missing."""
        bin_s = self._period_s / BINS_PER_PERIOD
        is_whole = len(time_s) > 1 and time_s[-1] - time_s[0] > (WINDOW_PERIODS - 0.1) * self._period_s
        if not is_whole or np.isnan(force_g).any() or np.diff(time_s).max() > 3 * bin_s:
            return None
        noise_g = effective_noise_g(force_g, None)
        columns, _ = means_by_group(np.floor((time_s - time_s[0]) / bin_s), np.column_stack([time_s, force_g]))
        time_s, force_g, per_bin = columns[:, 0], columns[:, 1:], max(len(time_s) / len(columns), 1.0)
        noise_g = noise_g / np.sqrt(per_bin)
        rate_1_s = self._dominant_rate(time_s, force_g)
        middle_s, half_s = float(time_s[0] + time_s[-1]) / 2, float(time_s[-1] - time_s[0]) / 2
        place = (time_s - middle_s) / half_s
        for _ in range(3):
            mean_g, waves_g, residual_g = _fit_harmonics(place, force_g, rate_1_s * half_s)
            first = waves_g[0, :, :2]
            power = float((np.abs(first[0]) ** 2).sum())
            along = (first.conj()[0] * first).sum(axis=1) / max(power, 1e-30)
            if np.sqrt(power) < REST_RAD * self._lever:
                break
            rate_1_s += float(np.clip(along[1].imag, -0.5, 0.5)) / half_s
        amplitude_g = float(np.sqrt(power))
        is_rest = amplitude_g < REST_RAD * self._lever
        angle_rad = amplitude_g / max(self._lever, 0.05)
        axial_g = 0.0 if is_rest else angle_rad**2 / 2
        allowed_g = np.array([amplitude_g, amplitude_g, 4 * axial_g]) * (0.0 if is_rest else SWING_RATIO)
        if np.any(residual_g > np.hypot(NOISE_RATIO * noise_g, np.maximum(allowed_g, REST_RAD**2))):
            return None
        is_swing = LEAST_SWING_RAD < angle_rad < LARGEST_SWING_RAD
        ratio = 2 * np.pi / rate_1_s / self._period_s
        grows = along[1].real > MAX_GROWTH or abs(along[2].imag) > MAX_PHASE_RAD
        if not is_rest and (not is_swing or grows or not PERIOD_RATIOS[0] < ratio < PERIOD_RATIOS[1]):
            return None
        binned_s = bin_s if per_bin >= 2 else 0.0
        return FreeWindow(
            middle_s=middle_s,
            half_s=half_s,
            rate_1_s=2 * np.pi / self._period_s if is_rest else rate_1_s,
            mean_g=mean_g,
            waves_g=0 * waves_g if is_rest else waves_g,
            noise_g=float(residual_g[2] / np.sqrt(len(time_s))),
            spread_s2=binned_s**2 / 12 + spread_s(self._housing.bandwidth_hz) ** 2,
            is_swing=not is_rest,
        )

    def _dominant_rate(self, time_s: Array, force_g: Array) -> float:
        """Return the angular frequency of the strongest oscillation across the rope in the range of the rope's."""
        place = np.linspace(-1, 1, len(time_s))
        across = force_g[:, :2] - np.stack(
            [np.polyval(np.polyfit(place, x, 2), place) for x in force_g[:, :2].T], axis=1
        )
        spectrum = np.abs(np.fft.rfft(across * np.hanning(len(across))[:, None], 8 * len(across), axis=0))
        rate_1_s = 2 * np.pi * np.fft.rfftfreq(8 * len(across), (time_s[-1] - time_s[0]) / (len(time_s) - 1))
        period = 2 * np.pi / np.maximum(rate_1_s, 1e-9) / self._period_s
        power = np.where((period > PERIOD_RATIOS[0]) & (period < PERIOD_RATIOS[1]), (spectrum**2).sum(axis=1), 0.0)
        return float(rate_1_s[int(np.argmax(power))])


def _fit_harmonics(place: Array, force_g: Array, phase_rad: float) -> tuple[Array, NDArray[np.complex128], Array]:
    """Return the mean (3, 3), harmonics (4, 3, 3) and the residual's standard deviation (3,); phase at the end of a window."""
    powers = place[:, None] ** np.arange(3)
    turn = np.exp(1j * phase_rad * np.outer(place, np.arange(1, 5)))
    waves = [turn[:, :1] * powers, turn[:, 1:2] * powers, turn[:, 2:]]
    basis = np.hstack([powers, *(part for wave in waves for part in (wave.real, -wave.imag))])
    found, *_ = np.linalg.lstsq(basis, force_g, rcond=None)
    residual_g = np.sqrt(((force_g - basis @ found) ** 2).sum(axis=0) / max(len(place) - basis.shape[1], 1))
    harmonics = np.zeros((4, 3, 3), dtype=np.complex128)
    harmonics[0], harmonics[1] = found[3:6] + 1j * found[6:9], found[9:12] + 1j * found[12:15]
    harmonics[2:, 0] = found[15:17] + 1j * found[17:19]
    return found[:3], harmonics, residual_g
