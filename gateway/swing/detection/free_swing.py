"""The free swing of a recording that may begin and end under a hand, found by the data alone.

A free swing repeats itself: harmonics of one period, whose amplitudes drift slowly, describe any two periods of it to the
noise. What precedes or follows it is taken for a hand's work only where no rope could have done it; a crane at work, a load at
rest and a recording without a swing keep their whole length.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.stats import true_runs
from gateway.swing.data.bins import validated_samples
from gateway.swing.detection.periodicity import (
    COMPARED_PERIODS,
    LOCAL_RATIOS,
    Series,
    find_period_s,
    fit_drifting_windows,
    harmonic_basis,
    resample,
)

INSET_PERIODS = 0.5
"""Distance of the extrapolated window from the end that the windows show: they may contain a little of what follows."""
BOUNDARY_REACH_PERIODS = 1.5
MEAN_PERIODS = 1 / 16
"""Residuals are averaged over this."""
RESIDUAL_SIGMA, TOLERANCE_RATIO = 2.5, 1.5
MAX_UNKNOWN_WINDOW_SHARE = 0.7


def swing_boundary(series: Series, period: float, part: tuple[int, int], tolerance: float, *, forward: bool) -> int:
    """Return the last sample of a free swing in time (`forward`) or the first one.

    `part`: first and last sample that the windows show; `tolerance`: residual over the oscillation, rms.
    """
    last = len(series) - 1
    values, (first, end) = series.force_g, part
    if not forward:
        values, (first, end) = values[::-1], (last - part[1], last - part[0])
    stop = end + 1 - round(INSET_PERIODS * period)
    start = max(stop - round(COMPARED_PERIODS * period), first)
    reached = _extrapolate(
        values[start : stop + round(BOUNDARY_REACH_PERIODS * period)], stop - start, period, series, tolerance
    )
    found = start + reached
    return found if forward else last - found


def _extrapolate(values: Array, count: int, period: float, series: Series, tolerance: float) -> int:
    """Return the last of the values (n, 3) that follows the harmonics of the first `count`."""
    places = np.arange(len(values)) - (count - 1) / 2
    best: tuple[float, Array, Array] | None = None
    for ratio in LOCAL_RATIOS:
        for drifts in (False, True):
            basis = harmonic_basis(places, ratio * period, drifts=drifts)
            if basis.shape[1] > MAX_UNKNOWN_WINDOW_SHARE * count:
                continue
            fitted = basis @ np.linalg.lstsq(basis[:count], values[:count], rcond=None)[0]
            variance = float(((values - fitted)[:count] ** 2).sum()) / (count - basis.shape[1])
            if best is None or variance < best[0]:
                best = variance, basis, fitted
    if best is None:
        return count - 1
    variance, basis, fitted = best
    inverse = np.linalg.pinv(basis[:count].T @ basis[:count])
    leverage = np.sqrt(1 + np.einsum("ij,jk,ik->i", basis, inverse, basis))
    sigma_g = np.sqrt(variance + series.total_noise_g**2)
    swing_g = np.sqrt(fitted[:count].var(axis=0).sum())
    width = max(1, round(MEAN_PERIODS * period))
    size_g = np.linalg.norm(values - fitted, axis=1)
    mean_g = np.convolve(size_g, np.full(width, 1 / width), "valid")
    allowed_g = RESIDUAL_SIGMA * sigma_g * leverage[: len(mean_g)] + TOLERANCE_RATIO * tolerance * swing_g
    apart = np.flatnonzero(mean_g[count:] > allowed_g[count:])
    return len(values) - 1 if len(apart) == 0 else count - 1 + int(apart[0]) + width // 2


MAX_PIVOT_ACCELERATION_G = 0.22
"""Acceleration of a pivot that is no crane's, over g. Basis: drives reach 0.06; what the integration adds reaches 0.20 on
simulated work of cranes, where a gust or drive begins unnoticed."""
REACH_PERIODS = 0.75
"""Time from the end of a free swing over which the force is integrated: an error of the equilibrium then counts eleven times."""
EQUILIBRIUM_PERIODS = 2.0
"""Part of the free swing next to its end whose mean is the equilibrium."""
SLOPE_PERIODS = 0.15
"""Part of the free swing next to its end that gives the first value and slope."""
SAMPLES_PER_PERIOD = 32
MIN_FREE_PERIODS = 3.0
"""Shortest free swing."""
MIN_SWING_SHARE = 0.1
"""Least swing relative to the largest one of the recording, for a free swing of its own."""
MIN_SWING_OVER_NOISE = 1.5
"""Least rms of a swing over the noise of one sample."""
MAX_END_PERIODS = 0.2
"""Length of an end without a free swing that is left with it."""
MAX_GAP_DISTANCE_PERIODS = 0.25
"""Distance from the end of a swing within which missing samples, and no hand, may have ended it."""


def pivot_acceleration_g(swing_g: Array, beside_g: Array, period: float) -> float:
    """Return the largest acceleration of the pivot over g that explains what follows a free swing, times 1 - rho.

    So what lies beside a free swing was held or moved by a hand, or by rope and crane. On a rope that a crane carries, the
    transverse force u (less that of equilibrium, over 1 - rho) moves the load by theta'' = -w0^2 u, and u - theta is the
    acceleration of the pivot over g (Łuczak et al. 2022, section 8, with a moving pivot). Integrated from the end of a free
    swing, where theta = u, the readings themselves state the acceleration that a crane would have needed. The factor 1 - rho is
    not known; without it that acceleration is too small, never too large.

    Both of shape (n, 3), with the period in samples; what precedes a swing is judged with both reversed in time.
    """
    equilibrium_g = swing_g[-round(EQUILIBRIUM_PERIODS * period) :].mean(axis=0)
    up = equilibrium_g / np.linalg.norm(equilibrium_g)
    across = np.eye(3) - np.outer(up, up)
    near_g = (swing_g[-max(4, round(SLOPE_PERIODS * period)) :] - equilibrium_g) @ across
    force_g = (beside_g[: round(REACH_PERIODS * period)] - equilibrium_g) @ across
    if len(force_g) == 0:
        return 0.0
    slope, start = np.polyfit(np.arange(len(near_g)) - (len(near_g) - 1), near_g, min(2, len(near_g) - 2))[-2:]
    rate_squared = (2 * np.pi / period) ** 2
    forces = np.vstack([start, force_g])
    speed = np.vstack([slope, slope - rate_squared * np.cumsum((forces[1:] + forces[:-1]) / 2, axis=0)])
    angle = start + np.cumsum((speed[1:] + speed[:-1]) / 2, axis=0)
    return float(np.linalg.norm(force_g - angle, axis=1).max())


@dataclass(frozen=True, slots=True)
class Interval:
    """A part of a recording."""

    from_s: float
    to_s: float

    @property
    def duration_s(self) -> float:
        """Length."""
        return self.to_s - self.from_s


@dataclass(frozen=True, slots=True)
class FreeSwing:
    """Where a recording swings freely."""

    intervals: tuple[Interval, ...]
    """Oldest first, at least one; the whole recording where nothing was held."""
    held: tuple[Interval, ...]
    """What lies before, between and after them: held, released or caught."""
    period_s: float | None
    """Measured period, of the strongest repetition: near the load, where only the axial force shows it, half of the swing's. None
    where nothing repeats."""

    @property
    def longest(self) -> Interval:
        """The longest interval."""
        return max(self.intervals, key=lambda interval: interval.duration_s)

    @property
    def is_whole(self) -> bool:
        """Nothing was held."""
        return not self.held


def find_free_swing(time_s: Array, force_g: Array, noise_g: float | Array | None = None) -> FreeSwing:
    """Return where a recording swings freely; times (n,) never falling, specific force (n, 3), noise per sample and axis.

    Needs no rope length and no position of the housing, which may be askew. Raises `ValueError` for arrays of wrong shape or
    falling times.
    """
    time_s, force_g = validated_samples(time_s, force_g)
    time_s, first = np.unique(time_s, return_index=True)
    if len(time_s) < SAMPLES_PER_PERIOD:
        ends = (float(time_s[0]), float(time_s[-1])) if len(time_s) else (0.0, 0.0)
        return FreeSwing((Interval(*ends),), (), None)
    force_g = force_g[first]
    whole = Interval(float(time_s[0]), float(time_s[-1]))
    period_s = find_period_s(time_s, force_g, noise_g)
    if period_s is None:
        return FreeSwing((whole,), (), None)
    series = resample(time_s, force_g, period_s / SAMPLES_PER_PERIOD, noise_g)
    swings = _swinging_parts(series, period_s / series.interval_s)
    if not swings:
        return FreeSwing((whole,), (), period_s)
    found = _between_hands(series, period_s / series.interval_s, swings)
    return found if found.held else replace(found, intervals=(whole,))


def _swinging_parts(series: Series, period: float) -> list[tuple[int, int]]:
    """Return first and last sample of each part that repeats itself, oldest first."""
    fits = fit_drifting_windows(series, period)
    if fits is None:
        return []
    length = fits.length
    found = []
    for start, stop in true_runs(fits.is_consistent(series.total_noise_g)):
        size_g = float(fits.swing_g[start:stop].max())
        if (
            stop - 1 + length - start >= MIN_FREE_PERIODS * period
            and size_g > MIN_SWING_OVER_NOISE * series.total_noise_g
        ):
            found.append((start, stop + length - 2, size_g))
    largest_g = max((size_g for _, _, size_g in found), default=0.0)
    tolerance = fits.tolerance(series.total_noise_g)
    refined = [
        _refined(series, period, (start, stop), tolerance)
        for start, stop, size_g in found
        if size_g >= MIN_SWING_SHARE * largest_g
    ]
    return [(start, stop) for start, stop in refined if stop - start >= MIN_FREE_PERIODS * period]


def _refined(series: Series, period: float, part: tuple[int, int], tolerance: float) -> tuple[int, int]:
    """Return a part with the ends by extrapolation; an end of the recording stays."""
    first, last = part
    if first > 0:
        first = swing_boundary(series, period, part, tolerance, forward=False)
    if last < len(series) - 1:
        last = swing_boundary(series, period, part, tolerance, forward=True)
    return first, last


def _between_hands(series: Series, period: float, swings: list[tuple[int, int]]) -> FreeSwing:
    """Return the parts that are free; all of the recording where no hand shows, at its ends together or between two swings.

    Where one shows, no crane is at work, and nothing beside a free swing belongs to it, unless samples are missing next to it: a
    gap shows no hand, and what lies beyond it is judged with the swing.
    """
    negligible = MAX_END_PERIODS * period
    last = len(series) - 1
    period_s = period * series.interval_s
    before, after = _accelerations_g(series, period, swings)
    ends = math.hypot(before[0], after[-1]) > MAX_PIVOT_ACCELERATION_G
    inner = list(zip(after[:-1], before[1:], strict=True))
    if not (ends or any(min(pair) > MAX_PIVOT_ACCELERATION_G for pair in inner)):
        return FreeSwing(_intervals(series, [(0, last)]), (), period_s)
    edge = round(MAX_GAP_DISTANCE_PERIODS * period)
    starts_at_gap = not series.known[max(swings[0][0] - edge, 0) : swings[0][0] + 1].all()
    ends_at_gap = not series.known[swings[-1][1] : swings[-1][1] + edge + 1].all()
    free = [list(swings[0])]
    for other, pair in zip(swings[1:], inner, strict=True):
        if max(pair) > MAX_PIVOT_ACCELERATION_G:
            free.append(list(other))
        free[-1][1] = other[1]
    free[0][0] = free[0][0] if free[0][0] > negligible and not starts_at_gap else 0
    free[-1][1] = free[-1][1] if last - free[-1][1] > negligible and not ends_at_gap else last
    edges = [0, *(edge for part in free for edge in part), last]
    held = [(begin, end) for begin, end in zip(edges[::2], edges[1::2], strict=True) if end > begin]
    return FreeSwing(_intervals(series, free), _intervals(series, held), period_s)


def _accelerations_g(series: Series, period: float, swings: list[tuple[int, int]]) -> tuple[list[float], list[float]]:
    """Return for each free swing the pivot's acceleration that explains what precedes it, and what follows it."""
    values, last = series.force_g, len(series) - 1
    negligible = MAX_END_PERIODS * period
    starts = [0, *(swing[1] + 1 for swing in swings[:-1])]
    stops = [*(swing[0] for swing in swings[1:]), last + 1]
    before, after = [], []
    for (first, end), start, stop in zip(swings, starts, stops, strict=True):
        swing_g = values[first : end + 1]
        earlier = _until_gap(values[start:first][::-1], series.known[start:first][::-1])
        later = _until_gap(values[end + 1 : stop], series.known[end + 1 : stop])
        before.append(pivot_acceleration_g(swing_g[::-1], earlier, period) if len(earlier) > negligible else 0.0)
        after.append(pivot_acceleration_g(swing_g, later, period) if len(later) > negligible else 0.0)
    return before, after


def _until_gap(values: Array, known: NDArray[np.bool_]) -> Array:
    """Return the values before the first one that is not known."""
    return values if known.all() else values[: int(known.argmin())]


def _intervals(series: Series, parts: Sequence[Sequence[int]]) -> tuple[Interval, ...]:
    return tuple(Interval(series.time_s(begin), series.time_s(end)) for begin, end in parts)
