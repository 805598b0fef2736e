"""Tracking a load while the rope's length changes: from an interval with constant length onward, a little at a time."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins
from gateway.swing.estimation.robust_fit import FitResult, fit_robust
from gateway.swing.fit.priors import hoisting_prior
from gateway.swing.model.motion import N_BASE_PARAMETERS, PendulumMotion
from gateway.swing.model.rope_spline import SplineGrid
from gateway.swing.rig import MountedHousing

RASTER_STEPS_PER_PERIOD = 10
MARGIN_PERIODS = 0.05
GROWTH_PERIODS = 0.3
"""Periods by which the window grows from fit to fit: a wrong speed must not cost more than a fraction of a swing."""
LOOK_BACK_PERIODS = 0.25
"""Periods before the end of the plain stretch at which the rope may have begun to move."""
HOIST_WINDOW_PERIODS = 3.5
"""Length of the window of one fit, in periods."""
CONVERGED_PERIODS, UNKNOWN_END_PERIODS = 1.5, 0.5
"""A stretch is settled when this much has been seen, but for its open end."""
MIN_RASTER_S = 0.3
HOIST_ITERATIONS = 8
MAX_HOIST_MISFIT = 0.03
MAX_HOIST_M_S = 2.0
"""Largest speed of a hoist: a faster one is something else that the splines took in."""


@dataclass(frozen=True, slots=True)
class FittedInterval:
    """The fit of a window, and the part of it that the fit describes."""

    from_s: float
    to_s: float
    result: FitResult

    @property
    def period_s(self) -> float:
        """Period of a small swing."""
        return self.result.fit.motion.period_s

    @property
    def periods(self) -> float:
        """Duration in periods."""
        return (self.to_s - self.from_s) / self.period_s


def _spline_step_s(rig: MountedHousing) -> float:
    """Return the step of the speed's splines for a nominal rig, so that all grids of a rig share their knots.

    A housing that moves with the rope reads every change of speed; one that stays in place reads only its effect on the swing.
    """
    step_s = rig.small_swing_period_s / RASTER_STEPS_PER_PERIOD
    return step_s if rig.above_load_m is None else min(step_s, MIN_RASTER_S)


def fit_hoist(
    bins: Bins,
    noise_g: Array,
    rig: MountedHousing,
    start: PendulumMotion,
    moving_s: tuple[float, float],
    iterations: int,
) -> FitResult | None:
    """Return the fit of a window whose rope moves between two times; None where that explains nothing.

    The grid of `start` covers the window.
    """
    splines = SplineGrid.covering(*moving_s, _spline_step_s(rig))
    prior = hoisting_prior(rig, splines.count)
    result = fit_robust(bins, noise_g, start.with_splines(splines), prior, iterations, max_misfit=MAX_HOIST_MISFIT)
    return result if result is not None and _is_plausible(result) else None


def track_forward(
    bins: Bins,
    noise_g: Array,
    rig: MountedHousing,
    motion: PendulumMotion,
    *,
    from_s: float,
    constant_to_s: float,
    to_s: float,
) -> list[FittedInterval]:
    """Return the intervals from `constant_to_s` up to `to_s`, as far as a rope that moves from about then on explains them.

    `motion` explains the data between `from_s` and `constant_to_s`.
    """
    found: list[FittedInterval] = []
    moving_from_s = constant_to_s - LOOK_BACK_PERIODS * motion.period_s
    end_s = known_s = constant_to_s
    while end_s < to_s:
        period_s = motion.period_s
        end_s = min(end_s + GROWTH_PERIODS * period_s, to_s)
        from_s = max(from_s, end_s - HOIST_WINDOW_PERIODS * period_s)
        start = motion.extended(max(from_s, motion.grid.start_s), end_s + MARGIN_PERIODS * period_s)
        moving_s = max(moving_from_s, from_s), end_s
        result = fit_hoist(bins.between(from_s, end_s), noise_g, rig, start, moving_s, HOIST_ITERATIONS)
        if result is None:
            break
        motion = result.fit.motion
        if result.is_valid and (end_s == to_s or end_s - known_s > CONVERGED_PERIODS * period_s):
            settled_s = end_s if end_s == to_s else end_s - UNKNOWN_END_PERIODS * period_s
            found.append(FittedInterval(known_s, settled_s, result))
            known_s = settled_s
    return found


def track_backward(
    bins: Bins,
    noise_g: Array,
    rig: MountedHousing,
    motion: PendulumMotion,
    *,
    from_s: float,
    constant_from_s: float,
    to_s: float,
) -> list[FittedInterval]:
    """Return the same backward, from `constant_from_s` down to `from_s`.

    `motion` explains the data between `constant_from_s` and `to_s`.
    """
    found: list[FittedInterval] = []
    moving_to_s = constant_from_s + LOOK_BACK_PERIODS * motion.period_s
    begin_s = known_s = constant_from_s
    while begin_s > from_s:
        period_s = motion.period_s
        begin_s = max(begin_s - GROWTH_PERIODS * period_s, from_s)
        to_s = min(to_s, begin_s + HOIST_WINDOW_PERIODS * period_s)
        start = motion.extended_backward(begin_s, to_s + MARGIN_PERIODS * period_s)
        moving_s = begin_s, min(moving_to_s, to_s)
        result = fit_hoist(bins.between(begin_s, to_s), noise_g, rig, start, moving_s, HOIST_ITERATIONS)
        if result is None:
            break
        motion = result.fit.motion
        if result.is_valid and (begin_s == from_s or known_s - begin_s > CONVERGED_PERIODS * period_s):
            settled_s = begin_s if begin_s == from_s else begin_s + UNKNOWN_END_PERIODS * period_s
            found.insert(0, FittedInterval(settled_s, known_s, result))
            known_s = settled_s
    return found


def _is_plausible(result: FitResult) -> bool:
    speeds_m_s = result.fit.motion.parameters[N_BASE_PARAMETERS:]
    return result.uncertainty.misfit <= MAX_HOIST_MISFIT and bool((np.abs(speeds_m_s) < MAX_HOIST_M_S).all())
