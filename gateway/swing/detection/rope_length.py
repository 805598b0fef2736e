"""The rope's length by the period of a free swing, with the amplitude's correction (Nelson and Olsson 1986)."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from devices.pendulum.small_swing import period_ratio, small_swing_length_m
from gateway.numerics.array import Array
from gateway.numerics.stats import robust_sigma
from gateway.swing.detection.free_swing import SAMPLES_PER_PERIOD, find_free_swing
from gateway.swing.detection.periodicity import Series, fit_windows, harmonic_basis, resample

TRIED_RATIOS = tuple(np.linspace(0.95, 1.05, 41))
"""Periods of a window, relative to that of the recording."""
LENGTH_WINDOW_PERIODS = 3.0
MIN_LENGTH_U_REL = 0.02
"""Smallest standard uncertainty of the length, relative: the grid of periods, damping, and the noise of the amplitude."""
AXIAL_SHARE = 0.5
"""Share of the fundamental along the rope from which on it is the second harmonic of the swing: near the load, the axial force
alone shows the swing, at twice its frequency."""


@dataclass(frozen=True, slots=True)
class LengthByPeriod:
    """A rope's length by the period."""

    length_m: float
    u_rel: float
    """Standard uncertainty, relative."""
    period_s: float
    """Of the swing as measured."""


def rope_length_by_period(time_s: Array, force_g: Array, gravity_m_s2: float) -> LengthByPeriod | None:
    """Return the length from pivot to load of a recording, times (n,), force (n, 3); None where nothing swings."""
    found = find_free_swing(time_s, force_g)
    if found.period_s is None:
        return None
    free = (time_s >= found.longest.from_s) & (time_s <= found.longest.to_s)
    series = resample(time_s[free], force_g[free], found.period_s / SAMPLES_PER_PERIOD)
    period = found.period_s / series.interval_s
    length = round(LENGTH_WINDOW_PERIODS * period)
    tries = {ratio: fit_windows(series, ratio * period, length, drifts=False) for ratio in TRIED_RATIOS}
    fits = {ratio: fit for ratio, fit in tries.items() if fit is not None}
    if not fits:
        return None
    best = np.argmin([fit.residual_g for fit in fits.values()], axis=0)
    doubled = 2.0 if _is_axial(series, period) else 1.0
    periods_s = doubled * found.period_s * np.array(list(fits))[best]
    up = series.force_g.mean(axis=0)
    axial = series.force_g @ up / np.linalg.norm(up)
    amplitudes_rad = np.arccos(np.clip(sliding_window_view(axial, length).min(axis=1), -1.0, 1.0))
    lengths_m = np.array(
        [
            small_swing_length_m(2 * np.pi * period_ratio(amplitude_rad) / period_s, gravity_m_s2)
            for period_s, amplitude_rad in zip(periods_s.tolist(), amplitudes_rad.tolist(), strict=True)
        ]
    )
    length_m = float(np.median(lengths_m))
    u_rel = float(np.hypot(MIN_LENGTH_U_REL, robust_sigma(lengths_m - length_m) / length_m))
    return LengthByPeriod(length_m, u_rel, float(np.median(periods_s)))


def _is_axial(series: Series, period: float) -> bool:
    """Return whether the fundamental of a series is along the rope, and all that there is along it.

    A sensor beside the rope reads the swing's own fundamental along it too, but beside a larger second harmonic.
    """
    places = np.arange(min(len(series), round(LENGTH_WINDOW_PERIODS * period))) - 0.0
    basis = harmonic_basis(places, period, drifts=False)
    harmonics = np.linalg.lstsq(basis, series.force_g[: len(places)], rcond=None)[0][1:5]
    up = series.force_g.mean(axis=0)
    first, second = ((harmonics[2 * n : 2 * n + 2] @ up / np.linalg.norm(up)) ** 2 for n in (0, 1))
    return bool(first.sum() > max(AXIAL_SHARE * (harmonics[:2] ** 2).sum(), second.sum()))
