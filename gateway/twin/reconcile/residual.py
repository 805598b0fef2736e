"""Whether a residual is more than noise, where, and what it is of the motion: its size, lines, direction and frequency."""

import math
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from gateway.numerics.spectrum import ZERO_PADDING, periodogram
from gateway.numerics.stats import autocorrelations, true_runs
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.data_checks import WRONG_FREQUENCY_RATIO
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.output.result import DIRECTIONS, Curves, Disagreement, Peak, Remainder, Residual

Array = NDArray[np.float64]
MAX_LAGS = 40
"""Number of lags of the Ljung-Box statistic, at most a fifth of the samples."""
MIN_WHITENESS_P = 0.001
"""Probability below which a residual is not white: white noise is called coloured once in 1000 recordings."""
PEAK_FALSE_ALARM_RATE = 1e-4
"""Probability that noise alone has a peak, over all frequencies and axes."""
FLOOR_REACH_BINS = 60
"""Independent frequencies on either side of which the median is the noise floor."""
MIN_FLOOR_REACH_BINS = 12
"""The same at the lowest frequencies, where the floor of slow noise is steep."""
MAX_PEAKS = 6
"""Number of peaks that are reported."""
SWING_BAND_HZ = (0.02, 1.5)
"""Band of the frequencies of swings and twice them; below it every fit removes the noise."""
MIN_BAND_BINS = 4
"""Fewest independent frequencies in the band that give a factor."""
EXCESS_SIGNIFICANT = 0.03
"""Excess of the reduced chi-square over 1 that is significant: a stated noise that is 1.5 % too small gives as much."""
EXCESS_LINES = 0.01
"""Excess from which spectral lines are sought: less is within the scatter of noise alone."""
EXCESS_LARGE = 0.5
"""Excess that no wrongly stated noise explains: it would have to be stated 22 % too small."""
BLOCK_S = 5.0
"""Length of a block, about a period of the swing."""
MIN_BLOCK_SAMPLES = 11
"""Fewest samples of a block; a shorter one at the end is left out."""
MIN_BLOCK_RMS_SIGMA = 1.25
"""Rms of a block above which it exceeds the noise; noise of 100 samples does so once in 3600 blocks."""
BAND_POWER_SHARE = 0.8
"""Share of the power in the band that is reported."""
MAX_MULTIPLE = 4
"""Largest multiple of the swing's frequency that is named."""
SAME_LINE_CYCLES = 1.5
"""Cycles in the recording by which two frequencies may differ and yet be one line."""
BLOCKS_PER_PERIOD = 2.0
"""Blocks by whose size a swing is told to be wide or small: half a period each."""


def ljung_box_p(residual: Array) -> float:
    """Return the probability that white noise has such an autocorrelation on one of the axes (n, 3) (Ljung and Box 1978).

    It is the smallest over the axes times their number (Bonferroni).
    """
    probabilities = []
    for axis in residual.T:
        n, lags = len(axis), min(MAX_LAGS, len(axis) // 5)
        rho = np.array(list(islice(autocorrelations(axis), lags)))
        if not len(rho):
            continue
        statistic = n * (n + 2) * float((rho**2 / (n - np.arange(1, lags + 1))).sum())
        probabilities.append(float(chdtrc(lags, statistic)))
    return min(1.0, len(probabilities) * min(probabilities, default=1.0))


def find_peaks(time_s: Array, residual: Array, noise_g: Array) -> tuple[Peak, ...]:
    """Return the spectral lines of a residual (n, 3) in sigma that exceed the noise floor around them, strongest first."""
    frequency_hz, power = periodogram(time_s, residual)
    bins = slice(ZERO_PADDING, None)  # a line has at least one period in the recording
    found: list[tuple[float, Peak]] = []
    for axis, name in enumerate("xyz"):
        ratio = power[bins, axis] / noise_floor(power[bins, axis])
        threshold = math.log(3 * len(ratio) / ZERO_PADDING / PEAK_FALSE_ALARM_RATE)
        for i in np.flatnonzero(ratio > threshold):
            if ratio[i] == ratio[max(0, i - ZERO_PADDING) : i + ZERO_PADDING + 1].max():
                amplitude_g = 2 * math.sqrt(power[bins, axis][i] / len(time_s)) * noise_g[axis]
                found.append((float(ratio[i]), Peak(float(frequency_hz[bins][i]), name, float(amplitude_g))))
    found.sort(key=lambda each: -each[0])
    return tuple(peak for _, peak in found[:MAX_PEAKS])


def noise_floor(power: Array) -> Array:
    """Return the mean of the noise around each frequency of a power spectrum (m,), from a running median."""
    floor = np.empty_like(power)
    reach = FLOOR_REACH_BINS * ZERO_PADDING
    for first in range(0, len(power), reach // 4):
        centre = first + reach // 8
        inside = min(reach, max(MIN_FLOOR_REACH_BINS * ZERO_PADDING, centre))
        around = power[max(0, centre - inside) : centre + inside]
        floor[first : first + reach // 4] = (
            np.median(around) / math.log(2) + 1e-12
        )  # power is exponentially distributed
    return floor


def analyse_residual(log: Curves, rig: TwinRig) -> Residual:
    """Return the whiteness of what the final model leaves in the log, and its lines, each with the swing's multiple it is at."""
    residual, swing_hz = log.residuals_sigma[1], swing_frequency_hz(log, rig)
    p, peaks = ljung_box_p(residual), find_peaks(log.time_s, residual, log.noise_g)
    peaks = tuple(replace(peak, multiple_of_swing=multiple_of_swing(peak.hz, swing_hz, log)) for peak in peaks)
    return Residual(p > MIN_WHITENESS_P, p, peaks)


def noise_inflation_factor(time_s: Array, residual: Array) -> float:
    """Return the spectral density of a residual (n, 3) in sigma in the band of swings, over that of white noise; at least 1.

    A fit of k parameters lowers the sum of squares of noise alone by k times this factor, so evidence is divided by it.
    """
    frequency_hz, power = periodogram(time_s, residual)
    lowest_hz = max(SWING_BAND_HZ[0], 2 / (time_s[-1] - time_s[0]))
    band = (frequency_hz > lowest_hz) & (frequency_hz < SWING_BAND_HZ[1])
    if band.sum() < MIN_BAND_BINS * ZERO_PADDING:
        return 1.0
    return max(1.0, float(power[band].mean()))


def has_excess(observations: Observations, fit: Fit) -> bool:
    """Return whether the residual is more than noise: significantly larger and with lines, or much larger."""
    excess = observations.reduced_chi2(fit.force_g) - 1
    return excess > EXCESS_LARGE or (excess > EXCESS_SIGNIFICANT and bool(residual_lines(observations, fit)))


def has_lines(observations: Observations, fit: Fit) -> bool:
    """Return whether the residual has spectral lines, even if it is hardly larger than noise."""
    return observations.reduced_chi2(fit.force_g) > 1 + EXCESS_LINES and bool(residual_lines(observations, fit))


def warrants_another_effect(observations: Observations, fit: Fit) -> bool:
    """Return whether a search should continue: the residual is significantly larger than noise, or has lines."""
    return observations.reduced_chi2(fit.force_g) > 1 + EXCESS_SIGNIFICANT or has_lines(observations, fit)


def residual_lines(observations: Observations, fit: Fit) -> tuple[Peak, ...]:
    """Return the spectral lines of the residual, strongest first."""
    return find_peaks(observations.time_s, observations.residual_sigma(fit.force_g), observations.noise_g)


def excess_chi2(observations: Observations, fit: Fit) -> float:
    """Return the chi-square of the residual beyond the largest that noise gives, 0 or more."""
    largest = (1 + EXCESS_SIGNIFICANT) * observations.n_values
    return max(0.0, observations.chi2(fit.force_g) - largest)


def localise_residual(time_s: Array, residual: Array) -> tuple[Disagreement, ...]:
    """Return the intervals, by axis, in which the blocks of a residual (n, 3) in sigma exceed the noise, largest first."""
    found: list[Disagreement] = []
    edges = np.searchsorted(time_s, np.arange(0, time_s[-1] + BLOCK_S, BLOCK_S))
    blocks = [(first, last) for first, last in pairwise(edges) if last - first >= MIN_BLOCK_SAMPLES]
    for axis, name in enumerate("xyz"):
        rms_sigma = [float(np.sqrt((residual[first:last, axis] ** 2).mean())) for first, last in blocks]
        for start, stop in true_runs([rms > MIN_BLOCK_RMS_SIGMA for rms in rms_sigma]):
            interval = slice(blocks[start][0], blocks[stop - 1][1])
            found.append(
                Disagreement(
                    axis=name,
                    from_s=float(time_s[interval.start]),
                    to_s=float(time_s[interval.stop - 1]),
                    band_hz=dominant_band_hz(time_s[interval], residual[interval][:, [axis]]),
                    rms_sigma=float(np.sqrt((residual[interval, axis] ** 2).mean())),
                )
            )
    return tuple(sorted(found, key=lambda each: -each.rms_sigma))


def dominant_band_hz(time_s: Array, residual: Array) -> tuple[float, float]:
    """Return the band of a residual (n, 1) that contains the middle `BAND_POWER_SHARE` of the power."""
    frequency_hz, power = periodogram(time_s, residual)
    share = np.cumsum(power[:, 0]) / max(float(power[:, 0].sum()), 1e-300)
    low, high = np.searchsorted(share, [(1 - BAND_POWER_SHARE) / 2, (1 + BAND_POWER_SHARE) / 2])
    return float(frequency_hz[low]), float(frequency_hz[min(high, len(frequency_hz) - 1)])


def describe_remainder(log: Curves, rig: TwinRig) -> Remainder:
    """Describe what the final model leaves in the log."""
    used = log.used
    noise_power = float((log.noise_g**2).sum())
    motion = log.measured_g[used] - log.measured_g[used].mean(axis=0)
    before, after = log.residual_before_g[used], log.residual_after_g[used]
    wide = _is_wide(log.time_s[used], motion, rig.small_swing_period_s)
    axes = np.eye(3)  # along the swing, across it and along the rope, in those of the housing
    axes[:2, :2] = np.linalg.eigh(motion[:, :2].T @ motion[:, :2])[1][:, ::-1]
    turned = after @ axes
    swing_hz = swing_frequency_hz(log, rig)
    axis = int(np.argmax((turned**2).sum(axis=0)))
    direction, peak = DIRECTIONS[axis], _strongest_line(log, turned, axis)
    return Remainder(
        share=_share(after, motion, noise_power),
        share_before=_share(before, motion, noise_power),
        share_wide_swing=_share(after[wide], motion[wide], noise_power),
        share_small_swing=_share(after[~wide], motion[~wide], noise_power),
        direction=direction,
        hz=None if peak is None else peak.hz,
        amplitude_g=None if peak is None else peak.amplitude_g,
        multiple_of_swing=None if peak is None else multiple_of_swing(peak.hz, swing_hz, log),
        is_slow=peak is not None and peak.hz < swing_hz / 2,
    )


def multiple_of_swing(hz: float, swing_hz: float, log: Curves) -> int | None:
    """Return which multiple of the swing's frequency a line is at, 1 to `MAX_MULTIPLE`; None where it is at none."""
    multiple = round(hz / swing_hz)
    resolution_hz = SAME_LINE_CYCLES / float(log.time_s[-1] - log.time_s[0])
    return multiple if 1 <= multiple <= MAX_MULTIPLE and abs(hz - multiple * swing_hz) < resolution_hz else None


def swing_frequency_hz(log: Curves, rig: TwinRig) -> float:
    """Return the frequency of the strongest line across the rope near that of the rig; at the load, where none is, the rig's."""
    rig_hz = 1 / rig.small_swing_period_s
    frequency_hz, power = periodogram(log.time_s, log.measured_g / log.noise_g)
    near = np.abs(np.log(np.maximum(frequency_hz, 1e-12) / rig_hz)) < np.log(WRONG_FREQUENCY_RATIO)
    across = power[near, :2].sum(axis=1)
    is_seen = bool(across.size) and across.max() > len(log.time_s) ** 0.5
    return float(frequency_hz[near][np.argmax(across)]) if is_seen else rig_hz


def _share(residual: Array, motion: Array, noise_power: float) -> float:
    left, moved = (max(float((each**2).sum(axis=1).mean()) - noise_power, 0.0) for each in (residual, motion))
    return math.sqrt(left / moved) if moved else 0.0


def _is_wide(time_s: Array, motion: Array, period_s: float) -> NDArray[np.bool_]:
    """Return which samples are in blocks with a wider swing than the median of them."""
    block = ((time_s - time_s[0]) * BLOCKS_PER_PERIOD / period_s).astype(int)
    _, block = np.unique(block, return_inverse=True)
    power = np.bincount(block, (motion**2).sum(axis=1)) / np.bincount(block)
    return (power > np.median(power))[block]


def _strongest_line(log: Curves, turned_g: Array, axis: int) -> Peak | None:
    """Return the line of the largest amplitude on one of the axes along the swing, across it and along the rope."""
    across_g = float(log.noise_g[:2].mean())
    noise_g = np.array([across_g, across_g, log.noise_g[2]])
    found = [peak for peak in find_peaks(log.time_s[log.used], turned_g / noise_g, noise_g) if peak.axis == "xyz"[axis]]
    return max(found, key=lambda peak: peak.amplitude_g, default=None)
