"""The boundary of a free swing, by extrapolation of its harmonics."""

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.detection.periodicity import COMPARED_PERIODS, LOCAL_RATIOS, Series, harmonic_basis

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
