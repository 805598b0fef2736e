"""Least-squares harmonics in sliding windows of an evenly spaced series: where it repeats, and with which period."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.stats import smallest_steps
from gateway.swing.data.input_checks import effective_noise_g

N_HARMONICS = 4
"""Basis: what the axial force of a swing of 90 degrees has beyond the fourth harmonic is below a hundredth."""
MIN_SAMPLES_PER_PERIOD = 2.5
"""Fewest samples in a period of each harmonic."""
DRIFTING_HARMONICS = 2
"""Harmonics whose amplitude and phase may change within a window: decay, and the period that depends on the amplitude."""
RESIDUAL_BLOCKS = 8
"""Parts of a window whose residuals are compared."""
FINEST_S = 0.02
MIN_PERIOD_S, MAX_PERIOD_S, PERIOD_RATIO = 0.4, 14.0, 1.025
"""Searched periods: half of that of a line of 0.2 m, to that of one of 48 m."""
SEARCH_PERIODS, SEARCH_SAMPLES_PER_PERIOD = 3.0, 16
SEARCH_TOLERANCES = (0.15, 0.3)
"""Unexplained over explained oscillation, rms, of a window that repeats; the second one where none does."""
MIN_COVERED_RATIO = 0.7
"""Time covered, relative to the most, by which a shorter period is preferred: all its multiples repeat too."""
PEAK_WINDOW = 6
"""Number of the next longer periods among which the best one is chosen."""
COMPARED_PERIODS = 2.0
LOCAL_RATIOS = tuple(1.04 ** np.arange(-5, 6))
"""Periods of a window relative to that of the recording. Basis: a swing of 90 degrees takes 1.18 times a small one."""
NOISE_RATIO, WORST_NOISE_RATIO, WORST_RATIO = 1.3, 1.8, 2.0
"""Residual over noise of a window and of its worst part; the latter's tolerance over the former's."""
MIN_TOLERANCE, MAX_TOLERANCE = 0.06, 0.2
"""Unexplained over explained oscillation, rms: twice what is usual in the recording, within these."""
MIN_TYPICAL_SWING = 3.0
"""Rms of a swing over the noise, from which on it shows what is usual."""
MAX_UNKNOWN_SHARE = 0.8
"""Largest share of unknown samples of a window."""


@dataclass(frozen=True, slots=True)
class Series:
    """Specific force at even intervals."""

    start_s: float
    interval_s: float
    force_g: Array
    """Shape (n, 3)."""
    known: NDArray[np.bool_]
    """False where the recording has no samples near, shape (n,)."""
    noise_g: Array
    """Noise and half a step of the quantisation, shape (3,)."""

    def __len__(self) -> int:
        return len(self.force_g)

    @property
    def total_noise_g(self) -> float:
        """Noise over all axes."""
        return float(np.sqrt((self.noise_g**2).sum()))

    def time_s(self, place: float) -> float:
        """Return the time of an index."""
        return self.start_s + place * self.interval_s


@dataclass(frozen=True, slots=True)
class WindowFits:
    """Fits of harmonics to all windows of one length; arrays of one entry for each window, by its first sample."""

    length: int
    swing_g: Array
    """Rms of the fitted oscillation, over all axes."""
    residual_g: Array
    """Rms of what is left, over all axes."""
    worst_g: Array
    """The same of the worst part of the window."""

    def tolerance(self, noise_g: float) -> float:
        """Return the permissible residual over the oscillation, beside the noise."""
        lively = self.swing_g > MIN_TYPICAL_SWING * noise_g
        if not lively.any():
            return MAX_TOLERANCE
        excess_g = np.sqrt(np.maximum(self.residual_g[lively] ** 2 - noise_g**2, 0.0))
        return float(np.clip(2 * np.median(excess_g / self.swing_g[lively]), MIN_TOLERANCE, MAX_TOLERANCE))

    def is_consistent(self, noise_g: float) -> NDArray[np.bool_]:
        """Return which windows the harmonics describe."""
        allowed_g = self.tolerance(noise_g) * self.swing_g
        usual = self.residual_g**2 <= (NOISE_RATIO * noise_g) ** 2 + allowed_g**2
        worst = self.worst_g**2 <= (WORST_NOISE_RATIO * noise_g) ** 2 + (WORST_RATIO * allowed_g) ** 2
        return np.asarray(usual & worst)


def resample(time_s: Array, force_g: Array, interval_s: float, noise_g: float | Array | None = None) -> Series:
    """Return samples, shapes (n,) and (n, 3), at even intervals: means of a denser series, a cubic through a sparser one."""
    return resampler(time_s, force_g, noise_g)(interval_s)


def resampler(time_s: Array, force_g: Array, noise_g: float | Array | None = None) -> Callable[[float], Series]:
    """Return `resample` of these samples for any interval; their spacing and their noise are measured once."""
    spacing_s = float(np.median(np.diff(time_s)))
    sample_noise_g, least_noise_g = effective_noise_g(force_g, noise_g), smallest_steps(force_g) / np.sqrt(12)

    def resampled(interval_s: float) -> Series:
        interval_s = max(interval_s, spacing_s)
        count = int((time_s[-1] - time_s[0]) / interval_s) + 1
        grid_s = time_s[0] + interval_s * np.arange(count)
        nearest = np.abs(time_s[np.clip(np.searchsorted(time_s, grid_s), 0, len(time_s) - 1)] - grid_s)
        before = np.abs(time_s[np.clip(np.searchsorted(time_s, grid_s) - 1, 0, len(time_s) - 1)] - grid_s)
        known = np.minimum(nearest, before) <= 1.5 * max(interval_s, spacing_s)
        cells = interval_s / spacing_s
        values = _cell_means(time_s, force_g, grid_s, interval_s) if cells >= 2 else _cubic(time_s, force_g, grid_s)
        noise = np.maximum(sample_noise_g / np.sqrt(max(cells, 1.0)), least_noise_g)
        return Series(float(time_s[0]), interval_s, values, known, noise)

    return resampled


def _cell_means(time_s: Array, force_g: Array, grid_s: Array, interval_s: float) -> Array:
    """Return the mean of the samples around each grid time; an empty cell has the value of a line through its neighbours."""
    cell = np.clip(np.rint((time_s - grid_s[0]) / interval_s).astype(np.int64), 0, len(grid_s) - 1)
    count = np.bincount(cell, minlength=len(grid_s))
    filled = np.flatnonzero(count)
    found = np.empty((len(grid_s), 3))
    for axis in range(3):
        mean_g = np.bincount(cell, weights=force_g[:, axis], minlength=len(grid_s))[filled] / count[filled]
        found[:, axis] = np.interp(np.arange(len(grid_s)), filled, mean_g)
    return found


def _cubic(time_s: Array, force_g: Array, grid_s: Array) -> Array:
    """Return cubic Hermite interpolation with the slopes of the parabola through each sample and its neighbours."""
    step = np.diff(time_s)
    slope = np.diff(force_g, axis=0) / step[:, None]
    inner = (slope[:-1] * step[1:, None] + slope[1:] * step[:-1, None]) / (step[:-1] + step[1:])[:, None]
    slopes = np.concatenate([slope[:1], inner, slope[-1:]])
    left = np.clip(np.searchsorted(time_s, grid_s, side="right") - 1, 0, len(time_s) - 2)
    width = step[left][:, None]
    x = (grid_s - time_s[left])[:, None] / width
    found: Array = (
        (1 + 2 * x) * (1 - x) ** 2 * force_g[left]
        + x * (1 - x) ** 2 * width * slopes[left]
        + x**2 * (3 - 2 * x) * force_g[left + 1]
        + x**2 * (x - 1) * width * slopes[left + 1]
    )
    return found


def harmonic_basis(places: NDArray[np.floating], period: float, *, drifts: bool) -> Array:
    """Return constant, cosines and sines at places in samples, shape (n, columns); with `drifts` also times the place."""
    harmonics = int(np.clip(period / MIN_SAMPLES_PER_PERIOD, 1, N_HARMONICS))
    angle = 2 * np.pi / period * places[:, None] * np.arange(1, harmonics + 1)
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(places), -1)
    columns = [np.ones((len(places), 1)), waves]
    if drifts:
        drifting = 2 * min(DRIFTING_HARMONICS, harmonics)
        columns.append(waves[:, :drifting] * (places / max(np.abs(places).max(), 1.0))[:, None])
    return np.concatenate(columns, axis=1)


def fit_windows(series: Series, period: float, length: int, *, drifts: bool, stride: int = 1) -> WindowFits | None:
    """Fit harmonics of a period in samples to windows of a length, one for each `stride` samples; None if that is too short."""
    if length > len(series):
        return None
    basis = harmonic_basis(np.arange(length) - (length - 1) / 2, period, drifts=drifts)
    if basis.shape[1] > MAX_UNKNOWN_SHARE * length:
        return None
    orthonormal = np.linalg.qr(basis)[0]  # its first column is the constant
    windows = sliding_window_view(series.force_g - series.force_g.mean(axis=0), length, axis=0)[::stride]
    fitted = windows @ orthonormal
    left = ((windows - fitted @ orthonormal.T) ** 2).sum(axis=1)
    edges = np.linspace(0, length, min(RESIDUAL_BLOCKS, length // 3) + 1).astype(int)[:-1]
    widths = np.diff(np.append(edges, length))
    worst = (np.add.reduceat(left, edges, axis=1) / widths).max(axis=1)
    residual = left.sum(axis=1) / (length - basis.shape[1])
    swing = (fitted[:, :, 1:] ** 2).sum(axis=(1, 2)) / length
    is_known = sliding_window_view(series.known, length)[::stride].all(axis=1)
    return WindowFits(
        length,
        np.sqrt(swing) * is_known,
        np.sqrt(np.where(is_known, residual, np.inf)),
        np.sqrt(np.where(is_known, worst, np.inf)),
    )


def find_period_s(time_s: Array, force_g: Array, noise_g: float | Array | None = None) -> float | None:
    """Return the shortest period with which most of what repeats in a recording does; None where nothing repeats."""
    base = resample(time_s, force_g, FINEST_S, noise_g)
    base_s: Array = base.start_s + base.interval_s * np.arange(len(base), dtype=np.float64)
    longest_s = min(MAX_PERIOD_S, len(base) * base.interval_s / SEARCH_PERIODS)
    count = int(np.log(max(longest_s / MIN_PERIOD_S, 1.0)) / np.log(PERIOD_RATIO)) + 1
    periods_s = MIN_PERIOD_S * PERIOD_RATIO ** np.arange(count)
    resampled = resampler(base_s, base.force_g, base.noise_g)
    covered_s = np.array([_covered_s(resampled, period_s) for period_s in periods_s.tolist()]).T
    best_s = next((row for row in covered_s if row.max() > 0), None)
    if best_s is None:
        return None
    first = int(np.flatnonzero(best_s >= MIN_COVERED_RATIO * best_s.max())[0])
    return float(periods_s[first + int(best_s[first : first + PEAK_WINDOW].argmax())])


def _covered_s(resampled: Callable[[float], Series], period_s: float) -> list[float]:
    """Return for each tolerance how much of a series repeats with a period."""
    series = resampled(period_s / SEARCH_SAMPLES_PER_PERIOD)
    period = period_s / series.interval_s
    stride = max(1, round(period / 4))
    fits = fit_windows(series, period, round(SEARCH_PERIODS * period), drifts=False, stride=stride)
    if fits is None:
        return [0.0] * len(SEARCH_TOLERANCES)
    noise_g = series.total_noise_g
    excess_g2 = fits.residual_g**2 - (WORST_NOISE_RATIO * noise_g) ** 2
    seen = fits.swing_g > noise_g
    step_s = stride * series.interval_s
    return [step_s * float((seen & (excess_g2 <= (each * fits.swing_g) ** 2)).sum()) for each in SEARCH_TOLERANCES]


def fit_drifting_windows(series: Series, period: float) -> WindowFits | None:
    """Fit drifting harmonics to all windows of two periods, each with the best of the periods near the stated one, in samples."""
    length = round(COMPARED_PERIODS * period)
    tries = [fit_windows(series, ratio * period, length, drifts=True) for ratio in LOCAL_RATIOS]
    fits = [fit for fit in tries if fit is not None]
    if not fits:
        return None
    best = np.argmin([fit.residual_g for fit in fits], axis=0)
    chosen = best, np.arange(len(best))
    swing, residual, worst = (
        np.array([getattr(fit, name) for fit in fits])[chosen] for name in ("swing_g", "residual_g", "worst_g")
    )
    return WindowFits(length, swing, residual, worst)
