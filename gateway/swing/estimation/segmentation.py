"""A recording in which something happened: the stretches that follow a free pendulum, each fitted by itself."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gateway.numerics.stats import NORMAL_975
from gateway.swing.data.bins import Bins
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.cross_segment_consistency import enforce_common_sensor_errors
from gateway.swing.estimation.hoist_tracking import FittedInterval, track_backward, track_forward
from gateway.swing.estimation.make_estimate import CHOICE, assess, hoisting_duration_s
from gateway.swing.estimation.robust_fit import FitResult, fit_robust, fit_robust_from, inflate_uncertainty
from gateway.swing.fit.initial_guess import find_harmonics, start_motions
from gateway.swing.fit.priors import Prior
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.rig import MountedHousing
from gateway.swing.uncertainty.peaks import largest_angle

SHORTEST_PERIODS, LONGEST_PERIODS = 1.2, 8.0
"""Of a stretch."""
STRIDE_PERIODS = 0.25
"""Between tries where nothing fits."""
LATER_PERIODS = (0.5, 1.0)
"""Where a plain stretch is looked for when the first one is not."""
FINEST_PERIODS = 0.125
"""To which the end of a stretch is found."""
LARGEST_MISFIT = 0.02
FEWEST_FITS, FITS_PER_PERIOD = 60, 2.0
"""Tries in one recording, the larger of both: a recording that is not a pendulum's is given up."""
ITERATIONS = 10
DIFFERENT = 3.0
"""Standard uncertainties between the rope's lengths in two pieces, from which on it has moved between them."""
TRIM_PERIODS = 1.0
"""Of a piece next to a moving rope: so long a movement can hide in the noise and still bias the swing."""
SHORTEST_CORE_PERIODS = 0.9
TAIL_PERIODS, OVERLAP_PERIODS = 2.0, 1.0
"""Of the pieces before and after, that a stretch with a moving rope is fitted with."""
OFFSET_SHARE = 0.5
"""Of the zero-g offset's standard uncertainty, that stays in an angle. On hoists with planted errors of all axes, pieces
believed to tell offset from lean by the axial force were wrong by up to 0.8 degrees, with an offset known to 1.4."""
HARMLESS_GAP_PERIODS = 0.5
"""An unfitted stretch this short cannot hide a larger angle than its neighbours show, unless it is forced for longer."""


@dataclass(slots=True)
class Segmenter:
    """Cuts a recording into pieces, with a bounded number of fits."""

    bins: Bins
    noise_g: Real
    beliefs: Prior
    period_s: float
    to_s: float
    fits: int = 0
    most_fits: float = FEWEST_FITS

    def cut(self, from_s: float) -> list[FittedInterval]:
        """All pieces from `from_s` on, oldest first."""
        found: list[FittedInterval] = []
        self.most_fits = max(FEWEST_FITS, FITS_PER_PERIOD * (self.to_s - from_s) / self.period_s)
        while from_s + SHORTEST_PERIODS * self.period_s <= self.to_s and self.fits < self.most_fits:
            piece = self._first(from_s)
            if piece is None:
                from_s += STRIDE_PERIODS * self.period_s
                continue
            if not piece.finding.plain and (plain := self._plain_soon(from_s)) is not None:
                found.append(replace(piece, to_s=min(piece.to_s, plain.from_s)))
                piece = plain
            piece = self._longest(piece)
            found.append(piece)
            from_s = piece.to_s
        return found

    def _first(self, from_s: float) -> FittedInterval | None:
        to_s = min(from_s + SHORTEST_PERIODS * self.period_s, self.to_s)
        window = self._window(from_s, to_s)
        if len(window) < 12:
            return None
        harmonics = find_harmonics(window, self.noise_g, self.beliefs.rig)
        starts = start_motions(harmonics, self.beliefs.rig, from_s, to_s + FINEST_PERIODS * self.period_s)
        self.fits += len(starts)
        finding = fit_robust_from(window, self.noise_g, starts, self.beliefs, ITERATIONS, worth=LARGEST_MISFIT)
        return self._stretch(from_s, to_s, finding)

    def _plain_soon(self, from_s: float) -> FittedInterval | None:
        """A stretch that begins a little later and follows the pendulum to the noise."""
        for later in LATER_PERIODS:
            begin_s = from_s + later * self.period_s
            if begin_s + SHORTEST_PERIODS * self.period_s <= self.to_s:
                piece = self._first(begin_s)
                if piece is not None and piece.finding.plain:
                    return piece
        return None

    def _longest(self, piece: FittedInterval) -> FittedInterval:
        """The piece drawn out until it no longer fits."""
        step = 0.5
        plain = piece
        while step >= FINEST_PERIODS and piece.to_s < self.to_s and self.fits < self.most_fits:
            if piece.to_s - piece.from_s > LONGEST_PERIODS * self.period_s:
                break
            to_s = min(piece.to_s + step * self.period_s, self.to_s)
            start = piece.finding.fit.motion.extended(piece.from_s, to_s + FINEST_PERIODS * self.period_s)
            window = self._window(piece.from_s, to_s)
            self.fits += 1
            instrument = piece.finding.fit.instrument
            finding = fit_robust(
                window, self.noise_g, start, self.beliefs, ITERATIONS, instrument, worth=LARGEST_MISFIT
            )
            longer = self._stretch(piece.from_s, to_s, finding)
            if longer is None:
                step /= 2
            else:
                piece = longer
                plain = piece if piece.finding.plain else plain
        return plain if plain.finding.plain else piece

    def _window(self, from_s: float, to_s: float) -> Bins:
        return self.bins.select((self.bins.time_s >= from_s) & (self.bins.time_s <= to_s))

    def _stretch(self, from_s: float, to_s: float, finding: FitResult | None) -> FittedInterval | None:
        if finding is None or not finding.sound or finding.claim.misfit > LARGEST_MISFIT:
            return None
        return FittedInterval(from_s, to_s, finding)


def fit_gaps_with_hoisting(
    pieces: list[FittedInterval], bins: Bins, noise_g: Real, beliefs: Prior, ends_s: tuple[float, float]
) -> list[FittedInterval]:
    """The pieces; where the rope's length changes between those that are long and plain, what that explains in their place."""
    rig, (from_s, to_s) = beliefs.rig, ends_s
    harmless_s = HARMLESS_GAP_PERIODS * pieces[0].period_s
    if all(end_s - begin_s <= harmless_s for begin_s, end_s in _gaps(pieces, from_s, to_s)) and not _lengths_differ(
        pieces
    ):
        return pieces
    cores = [core for piece in pieces if (core := _core(piece, bins, noise_g, beliefs, ends_s)) is not None]
    if not cores:
        return pieces
    hoists: list[FittedInterval] = []
    if cores[0].from_s - from_s > FINEST_PERIODS * cores[0].period_s:
        hoists += _before(cores[0], bins, noise_g, rig, from_s)
    for core, following in pairwise(cores):
        hoists += _between(core, following, bins, noise_g, rig)
    if to_s - cores[-1].to_s > FINEST_PERIODS * cores[-1].period_s:
        hoists += _after(cores[-1], bins, noise_g, rig, to_s)
    if not hoists:
        return pieces
    found = cores + hoists
    found += [p for p in pieces if all(p.to_s <= other.from_s or p.from_s >= other.to_s for other in found)]
    return sorted(found, key=lambda stretch: stretch.from_s)


def _lengths_differ(pieces: list[FittedInterval]) -> bool:
    """The rope is not as long in one piece as in the next."""
    return any(
        abs(np.log(one.finding.fit.motion.length_m / other.finding.fit.motion.length_m))
        > DIFFERENT * np.hypot(one.finding.claim.length_deviation_rel, other.finding.claim.length_deviation_rel)
        for one, other in pairwise(pieces)
    )


def _core(
    piece: FittedInterval, bins: Bins, noise_g: Real, beliefs: Prior, ends_s: tuple[float, float]
) -> FittedInterval | None:
    """A long plain piece without the ends at which the rope may have begun to move unnoticed; None of another piece."""
    if not piece.finding.plain:
        return None
    opens = np.array([piece.from_s > ends_s[0], piece.to_s < ends_s[1]])
    spare_s = (piece.periods - SHORTEST_CORE_PERIODS) * piece.period_s / max(opens.sum(), 1)
    away_s = opens * min(TRIM_PERIODS * piece.period_s, spare_s)
    from_s, to_s = piece.from_s + float(away_s[0]), piece.to_s - float(away_s[1])
    window = bins.select((bins.time_s >= from_s) & (bins.time_s <= to_s))
    start = piece.finding.fit.motion.extended(from_s, to_s + FINEST_PERIODS * piece.period_s)
    finding = fit_robust(window, noise_g, start, beliefs, ITERATIONS, piece.finding.fit.instrument)
    return FittedInterval(from_s, to_s, finding) if finding is not None and finding.sound else None


def _after(core: FittedInterval, bins: Bins, noise_g: Real, rig: MountedHousing, to_s: float) -> list[FittedInterval]:
    from_s = max(core.from_s, core.to_s - TAIL_PERIODS * core.period_s)
    motion = core.finding.fit.motion
    return track_forward(bins, noise_g, rig, motion, from_s=from_s, plain_to_s=core.to_s, to_s=to_s)


def _before(
    core: FittedInterval, bins: Bins, noise_g: Real, rig: MountedHousing, from_s: float
) -> list[FittedInterval]:
    to_s = min(core.to_s, core.from_s + TAIL_PERIODS * core.period_s)
    motion = core.finding.fit.motion
    return track_backward(bins, noise_g, rig, motion, from_s=from_s, plain_from_s=core.from_s, to_s=to_s)


def _between(
    core: FittedInterval, following: FittedInterval, bins: Bins, noise_g: Real, rig: MountedHousing
) -> list[FittedInterval]:
    """Forward into the next one, else backward for what is left."""
    overlap_s = min(following.from_s + OVERLAP_PERIODS * following.period_s, following.to_s)
    found = [
        replace(stretch, to_s=min(stretch.to_s, following.from_s))
        for stretch in _after(core, bins, noise_g, rig, overlap_s)
        if stretch.from_s < following.from_s
    ]
    known_s = found[-1].to_s if found else core.to_s
    return found if known_s >= following.from_s else found + _before(following, bins, noise_g, rig, known_s)


def assess_pieces(
    pieces: list[FittedInterval], noise_g: Real, from_s: float, to_s: float, period_s: float
) -> SwingEstimate:
    """One estimate of all pieces; without an interval where too much of the recording follows no pendulum."""
    doubted = [replace(piece, finding=_offset_doubted(piece.finding)) for piece in pieces]
    pieces, disagreements = enforce_common_sensor_errors(doubted)
    parts = [assess(piece.finding, noise_g, piece.from_s, piece.to_s) for piece in pieces]
    largest = max(parts, key=lambda part: part.phi_max_rad or 0.0)
    gaps = _gaps(pieces, from_s, to_s)
    hiding = [gap for gap in gaps if gap[1] - gap[0] > HARMLESS_GAP_PERIODS * period_s]
    hoists_s = tuple(when for p in pieces for when in hoisting_duration_s(p.finding, p.from_s, p.to_s))
    said = [f"fitted in {len(pieces)} pieces"]
    if hoists_s:
        said.append(f"hoisting within {hoists_s[0][0]:.0f}-{hoists_s[-1][1]:.0f} s")
    if hiding:
        when = ", ".join(f"{a:.0f}-{b:.0f} s" for a, b in hiding)
        said.append(f"no free pendulum, and the largest angle unknown, at {when}")
    coverage_rad = None if hiding else _combine_segments(parts)
    return replace(
        largest,
        from_s=from_s,
        to_s=to_s,
        u_rad=None if coverage_rad is None else _joint_u_rad(largest, coverage_rad),
        coverage95_rad=coverage_rad,
        hoists_s=hoists_s,
        swings=tuple(swing for part in parts for swing in part.swings),
        reasons=(*said, *disagreements, *largest.reasons),
    )


def _offset_doubted(finding: FitResult) -> FitResult:
    """With a part of the stated offset in the angle: what a short piece sees of it, other errors of the axes may have made."""
    offset_g = float(max(finding.fit.beliefs.rig.zero_g_offset_u_g[:2]))
    angle_rad, _ = largest_angle(finding.fit, finding.claim)
    return inflate_uncertainty(finding, OFFSET_SHARE * offset_g / max(angle_rad, 1e-6))


def _combine_segments(parts: list[SwingEstimate]) -> tuple[float, float] | None:
    """The interval of the largest angle of all: any part may hold it."""
    coverages = [part.coverage95_rad for part in parts]
    known = [coverage for coverage in coverages if coverage is not None]
    if len(known) < len(parts):
        return None
    return max(low for low, _ in known), max(high for _, high in known)


def _joint_u_rad(largest: SwingEstimate, coverage_rad: tuple[float, float]) -> float:
    """At least that of the largest part, and what the joint interval stands for."""
    above_rad = coverage_rad[1] - (largest.phi_max_rad or 0.0)
    return max(largest.u_rad or 0.0, above_rad / (CHOICE * NORMAL_975))


def _gaps(pieces: list[FittedInterval], from_s: float, to_s: float) -> list[tuple[float, float]]:
    """Stretches between the pieces and at the ends."""
    starts = np.array([*(piece.from_s for piece in pieces), to_s])
    ends = np.array([from_s, *(piece.to_s for piece in pieces)])
    return [(float(end), float(start)) for end, start in zip(ends, starts, strict=True) if start > end]
