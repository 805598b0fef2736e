"""A recording in which something happened: the stretches that follow a free pendulum, each fitted by itself."""

from dataclasses import dataclass, replace

import numpy as np

from gateway.stages.swing.assess import assess
from gateway.stages.swing.beliefs import Beliefs
from gateway.stages.swing.bins import Bins
from gateway.stages.swing.estimate import SwingEstimate
from gateway.stages.swing.explain import Finding, find, find_from
from gateway.stages.swing.model import Real
from gateway.stages.swing.start import find_harmonics, start_motions

SHORTEST_PERIODS, LONGEST_PERIODS = 1.2, 8.0
"""Of a stretch."""
STRIDE_PERIODS = 0.25
"""Between tries where nothing fits."""
FINEST_PERIODS = 0.125
"""To which the end of a stretch is found."""
LARGEST_MISFIT = 0.02
FEWEST_FITS, FITS_PER_PERIOD = 60, 2.0
"""Tries in one recording, the larger of both: a recording that is not a pendulum's is given up."""
ITERATIONS = 10
HARMLESS_GAP_PERIODS = 0.5
"""An unfitted stretch this short cannot hide a larger angle than its neighbours show, unless it is forced for longer."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch that follows a pendulum."""

    from_s: float
    to_s: float
    finding: Finding


@dataclass(slots=True)
class Cutter:
    """Cuts a recording into pieces, with a bounded number of fits."""

    bins: Bins
    noise_g: Real
    beliefs: Beliefs
    period_s: float
    to_s: float
    fits: int = 0
    most_fits: float = FEWEST_FITS

    def cut(self, from_s: float) -> list[Piece]:
        """All pieces from `from_s` on, oldest first."""
        found: list[Piece] = []
        self.most_fits = max(FEWEST_FITS, FITS_PER_PERIOD * (self.to_s - from_s) / self.period_s)
        while from_s + SHORTEST_PERIODS * self.period_s <= self.to_s and self.fits < self.most_fits:
            piece = self._first(from_s)
            if piece is None:
                from_s += STRIDE_PERIODS * self.period_s
                continue
            piece = self._longest(piece)
            found.append(piece)
            from_s = piece.to_s
        return found

    def _first(self, from_s: float) -> Piece | None:
        to_s = min(from_s + SHORTEST_PERIODS * self.period_s, self.to_s)
        window = self._window(from_s, to_s)
        if len(window) < 12:
            return None
        harmonics = find_harmonics(window, self.noise_g, self.beliefs.rig)
        starts = start_motions(harmonics, self.beliefs.rig, from_s, to_s + FINEST_PERIODS * self.period_s)
        self.fits += len(starts)
        return self._piece(from_s, to_s, find_from(window, self.noise_g, starts, self.beliefs, ITERATIONS))

    def _longest(self, piece: Piece) -> Piece:
        """The piece drawn out until it no longer fits."""
        step = 0.5
        while step >= FINEST_PERIODS and piece.to_s < self.to_s and self.fits < self.most_fits:
            if piece.to_s - piece.from_s > LONGEST_PERIODS * self.period_s:
                break
            to_s = min(piece.to_s + step * self.period_s, self.to_s)
            start = piece.finding.fit.motion.extended(piece.from_s, to_s + FINEST_PERIODS * self.period_s)
            window = self._window(piece.from_s, to_s)
            self.fits += 1
            longer = self._piece(
                piece.from_s,
                to_s,
                find(window, self.noise_g, start, self.beliefs, ITERATIONS, piece.finding.fit.instrument),
            )
            if longer is None:
                step /= 2
            else:
                piece = longer
        return piece

    def _window(self, from_s: float, to_s: float) -> Bins:
        return self.bins.select((self.bins.time_s >= from_s) & (self.bins.time_s <= to_s))

    def _piece(self, from_s: float, to_s: float, finding: Finding | None) -> Piece | None:
        if finding is None or not finding.sound or finding.claim.misfit > LARGEST_MISFIT:
            return None
        return Piece(from_s, to_s, finding)


def assess_pieces(pieces: list[Piece], noise_g: Real, from_s: float, to_s: float, period_s: float) -> SwingEstimate:
    """One estimate of all pieces; without an interval where too much of the recording follows no pendulum."""
    parts = [assess(piece.finding, noise_g, piece.from_s, piece.to_s) for piece in pieces]
    largest = max(parts, key=lambda part: part.phi_max_rad or 0.0)
    gaps = _gaps(pieces, from_s, to_s)
    hiding = [gap for gap in gaps if gap[1] - gap[0] > HARMLESS_GAP_PERIODS * period_s]
    said = [f"fitted in {len(pieces)} pieces"]
    if hiding:
        when = ", ".join(f"{a:.0f}-{b:.0f} s" for a, b in hiding)
        said.append(f"no free pendulum, and the largest angle unknown, at {when}")
    return replace(
        largest,
        from_s=from_s,
        to_s=to_s,
        u_rad=None if hiding else largest.u_rad,
        coverage95_rad=None if hiding else largest.coverage95_rad,
        swings=tuple(swing for part in parts for swing in part.swings),
        reasons=(*said, *largest.reasons),
    )


def _gaps(pieces: list[Piece], from_s: float, to_s: float) -> list[tuple[float, float]]:
    """Stretches between the pieces and at the ends."""
    starts = np.array([*(piece.from_s for piece in pieces), to_s])
    ends = np.array([from_s, *(piece.to_s for piece in pieces)])
    return [(float(end), float(start)) for end, start in zip(ends, starts, strict=True) if start > end]
