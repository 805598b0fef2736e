"""A load followed while the rope's length changes: from a stretch that a plain pendulum explains, onward a little at a time."""

from dataclasses import dataclass

import numpy as np

from gateway.swing.data.bins import Bins
from gateway.swing.estimation.robust_fit import FitResult, fit_robust
from gateway.swing.fit.priors import hoisting_prior
from gateway.swing.model.motion import PLAIN, Motion
from gateway.swing.model.rope_spline import SplineGrid
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.rig import MountedHousing

RASTER_STEPS_PER_PERIOD = 10
MARGIN_PERIODS = 0.05
STRIDE_PERIODS = 0.3
"""By which the window grows from fit to fit: a wrong speed must not cost more than a fraction of a swing."""
BACK_PERIODS = 0.25
"""How far before the end of the plain stretch the rope may have begun to move."""
WINDOW_PERIODS = 3.5
"""Of one fit."""
SETTLED_PERIODS, OPEN_PERIODS = 1.5, 0.5
"""A stretch is settled when this much has been seen, but for its open end."""
FINEST_RASTER_S = 0.3
ITERATIONS = 8
LARGEST_MISFIT = 0.03
FASTEST_M_S = 2.0
"""No hoist: something else that the splines took in."""


@dataclass(frozen=True, slots=True)
class FittedInterval:
    """What a fit says of a part of its window."""

    from_s: float
    to_s: float
    finding: FitResult

    @property
    def period_s(self) -> float:
        """Of a small swing."""
        return self.finding.fit.motion.period_s

    @property
    def periods(self) -> float:
        """How long it is."""
        return (self.to_s - self.from_s) / self.period_s


def raster_step_s(rig: MountedHousing) -> float:
    """Step of the raster, from the believed rig, so that all rasters of a rig share their instants.

    A housing that goes with the rope feels every change of speed; one that stays feels only what the swing makes of it.
    """
    step_s = rig.small_swing_period_s / RASTER_STEPS_PER_PERIOD
    return step_s if rig.above_load_m is None else min(step_s, FINEST_RASTER_S)


def hoist_find(
    bins: Bins,
    noise_g: Real,
    rig: MountedHousing,
    start: Motion,
    moves_s: tuple[float, float],
    iterations: int,
    step_s: float | None = None,
) -> FitResult | None:
    """The fit of a window whose rope moves between two times; None where that explains nothing. `start` covers the window."""
    raster = SplineGrid.over(*moves_s, step_s or raster_step_s(rig))
    finding = fit_robust(
        bins, noise_g, start.hoisting(raster), hoisting_prior(rig, raster.count), iterations, worth=LARGEST_MISFIT
    )
    return finding if finding is not None and _credible(finding) else None


def track_forward(
    bins: Bins, noise_g: Real, rig: MountedHousing, motion: Motion, *, from_s: float, plain_to_s: float, to_s: float
) -> list[FittedInterval]:
    """The stretches from `plain_to_s` up to `to_s`, of a rope that moves from about then on, as far as that explains them.

    `motion` explains what lies between `from_s` and `plain_to_s`.
    """
    found: list[FittedInterval] = []
    moves_from_s = plain_to_s - BACK_PERIODS * motion.period_s
    end_s = known_s = plain_to_s
    while end_s < to_s:
        period_s = motion.period_s
        end_s = min(end_s + STRIDE_PERIODS * period_s, to_s)
        from_s = max(from_s, end_s - WINDOW_PERIODS * period_s)
        window = bins.select((bins.time_s >= from_s) & (bins.time_s <= end_s))
        start = motion.extended(max(from_s, motion.grid.start_s), end_s + MARGIN_PERIODS * period_s)
        finding = hoist_find(window, noise_g, rig, start, (max(moves_from_s, from_s), end_s), ITERATIONS)
        if finding is None:
            break
        motion = finding.fit.motion
        if finding.sound and (end_s == to_s or end_s - known_s > SETTLED_PERIODS * period_s):
            settled_s = end_s if end_s == to_s else end_s - OPEN_PERIODS * period_s
            found.append(FittedInterval(known_s, settled_s, finding))
            known_s = settled_s
    return found


def track_backward(
    bins: Bins, noise_g: Real, rig: MountedHousing, motion: Motion, *, from_s: float, plain_from_s: float, to_s: float
) -> list[FittedInterval]:
    """The same backward, from `plain_from_s` down to `from_s`; `motion` explains what lies between `plain_from_s` and `to_s`."""
    found: list[FittedInterval] = []
    moves_to_s = plain_from_s + BACK_PERIODS * motion.period_s
    begin_s = known_s = plain_from_s
    while begin_s > from_s:
        period_s = motion.period_s
        begin_s = max(begin_s - STRIDE_PERIODS * period_s, from_s)
        to_s = min(to_s, begin_s + WINDOW_PERIODS * period_s)
        window = bins.select((bins.time_s >= begin_s) & (bins.time_s <= to_s))
        start = motion.extended_backward(begin_s, to_s + MARGIN_PERIODS * period_s)
        finding = hoist_find(window, noise_g, rig, start, (begin_s, min(moves_to_s, to_s)), ITERATIONS)
        if finding is None:
            break
        motion = finding.fit.motion
        if finding.sound and (begin_s == from_s or known_s - begin_s > SETTLED_PERIODS * period_s):
            settled_s = begin_s if begin_s == from_s else begin_s + OPEN_PERIODS * period_s
            found.insert(0, FittedInterval(settled_s, known_s, finding))
            known_s = settled_s
    return found


def _credible(finding: FitResult) -> bool:
    speeds_m_s = finding.fit.motion.parameters[PLAIN:]
    return finding.claim.misfit <= LARGEST_MISFIT and bool((np.abs(speeds_m_s) < FASTEST_M_S).all())
