"""Segmentation of a recording in which something happened: the intervals that follow a free pendulum, each fitted by itself."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.swing.data.bins import Bins
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.consistency import enforce_common_sensor_errors
from gateway.swing.estimation.hoist_tracking import FittedInterval, track_backward, track_forward
from gateway.swing.estimation.make_estimate import SELECTION_WIDENING, hoisting_intervals_s, make_estimate
from gateway.swing.estimation.robust_fit import (
    MIN_FITTED_BINS,
    FitResult,
    fit_robust,
    fit_robust_from,
    inflate_uncertainty,
)
from gateway.swing.fit.harmonics import find_harmonics
from gateway.swing.fit.initial_guess import initial_motions
from gateway.swing.fit.priors import Prior
from gateway.swing.model.spherical_pendulum import rope_angle
from gateway.swing.rig import MountedHousing
from gateway.swing.uncertainty.peaks import largest_angle

MIN_STRETCH_PERIODS, MAX_STRETCH_PERIODS = 1.2, 8.0
"""Shortest and longest stretch, in periods."""
STEP_PERIODS = 0.25
"""Periods between tries where nothing fits."""
RETRY_OFFSET_PERIODS = (0.5, 1.0)
"""Periods after the first try at which a plain stretch is looked for where that one finds none."""
END_RESOLUTION_PERIODS = 0.125
"""Resolution, in periods, to which the end of a stretch is found."""
MAX_SEGMENT_MISFIT = 0.02
MIN_FITS, FITS_PER_PERIOD = 60, 2.0
"""Tries in one recording, the larger of both: a recording that is not a pendulum's is given up."""
SEGMENT_ITERATIONS = 10
CONFLICT_SIGMA = 3.0
"""Standard uncertainties between the rope's lengths in two pieces, from which on it has moved between them."""
TRIM_PERIODS = 1.0
"""Periods that are cut from a piece next to a moving rope: so long a movement can hide in the noise and still bias the swing."""
MIN_CORE_PERIODS = 0.9
TAIL_PERIODS, OVERLAP_PERIODS = 2.0, 1.0
"""Periods of the pieces before and after, with which a stretch with a moving rope is fitted."""
OFFSET_SHARE = 0.5
"""Share of the zero-g offset's standard uncertainty that stays in an angle. On hoists with planted errors of all axes, pieces
believed to tell offset from lean by the axial force were wrong by up to 0.8 degrees, with an offset known to 1.4."""
MAX_BRIDGED_GAP_PERIODS = 0.5
"""An unfitted stretch this short cannot hide a larger angle than its neighbours show, unless it is forced for longer. At the end
there is no neighbour behind it, which would show what a drive has begun.
"""


@dataclass(slots=True)
class Segmenter:
    """Cuts a recording into segments, with a bounded number of fits."""

    bins: Bins
    noise_g: Array
    prior: Prior
    period_s: float
    to_s: float
    fits: int = 0
    max_fits: float = MIN_FITS

    def segments(self, from_s: float) -> list[FittedInterval]:
        """Return all segments from `from_s` on, oldest first."""
        found: list[FittedInterval] = []
        self.max_fits = max(MIN_FITS, FITS_PER_PERIOD * (self.to_s - from_s) / self.period_s)
        while from_s + MIN_STRETCH_PERIODS * self.period_s <= self.to_s and self.fits < self.max_fits:
            segment = self._first(from_s)
            if segment is None:
                from_s += STEP_PERIODS * self.period_s
                continue
            if not segment.result.is_explained and (explained := self._explained_soon(from_s)) is not None:
                found.append(replace(segment, to_s=min(segment.to_s, explained.from_s)))
                segment = explained
            segment = self._extend(segment)
            found.append(segment)
            from_s = segment.to_s
        return found

    def _first(self, from_s: float) -> FittedInterval | None:
        to_s = min(from_s + MIN_STRETCH_PERIODS * self.period_s, self.to_s)
        window = self.bins.between(from_s, to_s)
        if len(window) < MIN_FITTED_BINS:
            return None
        harmonics = find_harmonics(window, self.noise_g, self.prior.rig)
        guesses = initial_motions(harmonics, self.prior.rig, from_s, to_s + END_RESOLUTION_PERIODS * self.period_s)
        self.fits += len(guesses)
        result = fit_robust_from(
            window, self.noise_g, guesses, self.prior, SEGMENT_ITERATIONS, max_misfit=MAX_SEGMENT_MISFIT
        )
        return self._accepted(from_s, to_s, result)

    def _explained_soon(self, from_s: float) -> FittedInterval | None:
        """Return a segment that begins a little later and follows the pendulum to the noise."""
        for later in RETRY_OFFSET_PERIODS:
            begin_s = from_s + later * self.period_s
            if begin_s + MIN_STRETCH_PERIODS * self.period_s <= self.to_s:
                segment = self._first(begin_s)
                if segment is not None and segment.result.is_explained:
                    return segment
        return None

    def _extend(self, segment: FittedInterval) -> FittedInterval:
        """Return the segment, extended until it no longer fits."""
        step = 0.5
        explained = segment
        while step >= END_RESOLUTION_PERIODS and segment.to_s < self.to_s and self.fits < self.max_fits:
            if segment.to_s - segment.from_s > MAX_STRETCH_PERIODS * self.period_s:
                break
            fit, to_s = segment.result.fit, min(segment.to_s + step * self.period_s, self.to_s)
            start = fit.motion.extended(segment.from_s, to_s + END_RESOLUTION_PERIODS * self.period_s)
            window = self.bins.between(segment.from_s, to_s)
            self.fits += 1
            result = fit_robust(
                window, self.noise_g, start, self.prior, SEGMENT_ITERATIONS, fit.sensor, max_misfit=MAX_SEGMENT_MISFIT
            )
            longer = self._accepted(segment.from_s, to_s, result)
            if longer is None:
                step /= 2
            else:
                segment = longer
                explained = segment if segment.result.is_explained else explained
        return explained if explained.result.is_explained else segment

    def _accepted(self, from_s: float, to_s: float, result: FitResult | None) -> FittedInterval | None:
        if result is None or not result.is_valid or result.uncertainty.misfit > MAX_SEGMENT_MISFIT:
            return None
        return FittedInterval(from_s, to_s, result)


def fit_gaps_with_hoisting(
    segments: list[FittedInterval], bins: Bins, noise_g: Array, prior: Prior, ends_s: tuple[float, float]
) -> list[FittedInterval]:
    """Return the segments; where the rope's length changes between explained ones, what that explains in their place."""
    rig, (from_s, to_s) = prior.rig, ends_s
    harmless_s = MAX_BRIDGED_GAP_PERIODS * segments[0].period_s
    gaps = _gaps(segments, from_s, to_s)
    if all(end_s - begin_s <= harmless_s for begin_s, end_s in gaps) and not _lengths_differ(segments):
        return segments
    cores = [core for segment in segments if (core := _core(segment, bins, noise_g, prior, ends_s)) is not None]
    if not cores:
        return segments
    hoists: list[FittedInterval] = []
    if cores[0].from_s - from_s > END_RESOLUTION_PERIODS * cores[0].period_s:
        hoists += _before(cores[0], bins, noise_g, rig, from_s)
    for core, following in pairwise(cores):
        hoists += _between(core, following, bins, noise_g, rig)
    if to_s - cores[-1].to_s > END_RESOLUTION_PERIODS * cores[-1].period_s:
        hoists += _after(cores[-1], bins, noise_g, rig, to_s)
    if not hoists:
        return segments
    found = cores + hoists
    found += [s for s in segments if all(s.to_s <= other.from_s or s.from_s >= other.to_s for other in found)]
    return sorted(found, key=lambda segment: segment.from_s)


def _lengths_differ(segments: list[FittedInterval]) -> bool:
    """Return whether the rope has another length in one segment than in the next."""
    return any(
        abs(np.log(one.result.fit.motion.length_m / other.result.fit.motion.length_m))
        > CONFLICT_SIGMA * np.hypot(one.result.uncertainty.length_u_rel, other.result.uncertainty.length_u_rel)
        for one, other in pairwise(segments)
    )


def _core(
    segment: FittedInterval, bins: Bins, noise_g: Array, prior: Prior, ends_s: tuple[float, float]
) -> FittedInterval | None:
    """Return an explained segment without the ends at which the rope may have begun to move unnoticed; None for another."""
    if not segment.result.is_explained:
        return None
    is_open = np.array([segment.from_s > ends_s[0], segment.to_s < ends_s[1]])
    spare_s = (segment.periods - MIN_CORE_PERIODS) * segment.period_s / max(is_open.sum(), 1)
    trim_s = is_open * min(TRIM_PERIODS * segment.period_s, spare_s)
    from_s, to_s = segment.from_s + float(trim_s[0]), segment.to_s - float(trim_s[1])
    fit = segment.result.fit
    start = fit.motion.extended(from_s, to_s + END_RESOLUTION_PERIODS * segment.period_s)
    result = fit_robust(bins.between(from_s, to_s), noise_g, start, prior, SEGMENT_ITERATIONS, fit.sensor)
    return FittedInterval(from_s, to_s, result) if result is not None and result.is_valid else None


def _after(core: FittedInterval, bins: Bins, noise_g: Array, rig: MountedHousing, to_s: float) -> list[FittedInterval]:
    from_s = max(core.from_s, core.to_s - TAIL_PERIODS * core.period_s)
    motion = core.result.fit.motion
    return track_forward(bins, noise_g, rig, motion, from_s=from_s, constant_to_s=core.to_s, to_s=to_s)


def _before(
    core: FittedInterval, bins: Bins, noise_g: Array, rig: MountedHousing, from_s: float
) -> list[FittedInterval]:
    to_s = min(core.to_s, core.from_s + TAIL_PERIODS * core.period_s)
    motion = core.result.fit.motion
    return track_backward(bins, noise_g, rig, motion, from_s=from_s, constant_from_s=core.from_s, to_s=to_s)


def _between(
    core: FittedInterval, following: FittedInterval, bins: Bins, noise_g: Array, rig: MountedHousing
) -> list[FittedInterval]:
    """Return what is tracked forward into the following core, and backward for what that leaves."""
    overlap_s = min(following.from_s + OVERLAP_PERIODS * following.period_s, following.to_s)
    found = [
        replace(interval, to_s=min(interval.to_s, following.from_s))
        for interval in _after(core, bins, noise_g, rig, overlap_s)
        if interval.from_s < following.from_s
    ]
    known_s = found[-1].to_s if found else core.to_s
    return found if known_s >= following.from_s else found + _before(following, bins, noise_g, rig, known_s)


def combine_segments(
    segments: list[FittedInterval], noise_g: Array, from_s: float, to_s: float, period_s: float
) -> SwingEstimate:
    """Return one estimate of all segments; without an interval where too much of the recording follows no pendulum."""
    with_offset = [replace(segment, result=_with_offset_uncertainty(segment.result)) for segment in segments]
    segments, disagreements = enforce_common_sensor_errors(with_offset)
    parts = [make_estimate(segment.result, noise_g, segment.from_s, segment.to_s) for segment in segments]
    largest = max(parts, key=lambda part: part.phi_max_rad or 0.0)
    unknown = [
        (begin_s, end_s)
        for begin_s, end_s in _gaps(segments, from_s, to_s)
        if end_s - begin_s > period_s * (END_RESOLUTION_PERIODS if end_s == to_s else MAX_BRIDGED_GAP_PERIODS)
    ]
    hoists_s = tuple(when for s in segments for when in hoisting_intervals_s(s.result, s.from_s, s.to_s))
    reasons = [f"fitted in {len(segments)} segments"]
    if hoists_s:
        reasons.append(f"hoisting within {hoists_s[0][0]:.0f}-{hoists_s[-1][1]:.0f} s")
    if unknown:
        when = ", ".join(f"{begin_s:.0f}-{end_s:.0f} s" for begin_s, end_s in unknown)
        reasons.append(f"no free pendulum, and the largest angle unknown, at {when}")
    coverage_rad = None if unknown else _joint_coverage_rad(parts)
    if coverage_rad is not None:
        coverage_rad = coverage_rad[0], min(coverage_rad[1] * _growth_towards(segments[0], from_s), np.pi)
    return replace(
        largest,
        from_s=from_s,
        to_s=to_s,
        u_rad=None if coverage_rad is None else _joint_u_rad(largest, coverage_rad),
        coverage95_rad=coverage_rad,
        hoists_s=hoists_s,
        swings=tuple(swing for part in parts for swing in part.swings),
        reasons=(*reasons, *disagreements, *largest.reasons),
    )


def _with_offset_uncertainty(result: FitResult) -> FitResult:
    """Return the fit with a part of the stated offset in its angle: a short segment may mistake another error for an offset."""
    offset_g = float(max(result.fit.prior.rig.zero_g_offset_u_g[:2]))
    angle_rad, _ = largest_angle(result.fit, result.uncertainty)
    return inflate_uncertainty(result, OFFSET_SHARE * offset_g / max(angle_rad, 1e-6))


def _joint_coverage_rad(parts: list[SwingEstimate]) -> tuple[float, float] | None:
    """Return the interval of the largest angle of all parts, any of which may have it."""
    coverages = [part.coverage95_rad for part in parts]
    known = [coverage for coverage in coverages if coverage is not None]
    if len(known) < len(parts):
        return None
    return max(low for low, _ in known), max(high for _, high in known)


def _growth_towards(first: FittedInterval, from_s: float) -> float:
    """Return how much larger than in the first segment the angle was before it, by the segment's own decay; at least 1."""
    motion = first.result.fit.motion
    if from_s >= first.from_s:
        return 1.0
    before_rad = rope_angle(motion.extended_backward(from_s, first.from_s).nodes[0]).max()
    inside_rad = rope_angle(motion.extended(first.from_s, first.to_s).nodes[0]).max()
    return max(1.0, float(before_rad / inside_rad)) if np.isfinite(before_rad) else np.inf


def _joint_u_rad(largest: SwingEstimate, coverage_rad: tuple[float, float]) -> float:
    """Return the uncertainty that the joint interval stands for, at least that of the largest part."""
    above_rad = coverage_rad[1] - (largest.phi_max_rad or 0.0)
    return max(largest.u_rad or 0.0, above_rad / (SELECTION_WIDENING * NORMAL_975))


def _gaps(segments: list[FittedInterval], from_s: float, to_s: float) -> list[tuple[float, float]]:
    """Return the intervals between the segments and at the ends."""
    starts = np.array([*(segment.from_s for segment in segments), to_s])
    ends = np.array([from_s, *(segment.to_s for segment in segments)])
    return [(float(end), float(start)) for end, start in zip(ends, starts, strict=True) if start > end]
