"""A rope that becomes longer or shorter: its length over time by a spline, whose knots are unknowns of the fit.

The speed L' is a sum of quadratic B-splines on a uniform raster: without a jump in speed or acceleration, standing still
outside the raster, and free enough for any drive that ramps over more than a step. Length and acceleration follow exactly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
SUPPORT = 3
"""Steps that one spline reaches over."""
_BINOMIALS = ((0, 1.0), (1, -3.0), (2, 3.0), (3, -1.0))


@dataclass(frozen=True, slots=True)
class Rope:
    """Length and its two derivatives at some instants; arrays of one shape."""

    length_m: Real
    rate_m_s: Real
    acceleration_m_s2: Real


@dataclass(frozen=True, slots=True)
class SplineGrid:
    """Where the splines lie: number k rises from 0 at `start_s + k step_s` and is 0 again three steps later."""

    start_s: float
    step_s: float
    count: int

    @classmethod
    def over(cls, from_s: float, to_s: float, step_s: float) -> "SplineGrid":
        """All splines that are not 0 somewhere in between; rasters of one step share their instants."""
        first, last = np.floor(from_s / step_s) - SUPPORT + 1, np.ceil(to_s / step_s)
        return cls(float(first * step_s), step_s, int(last - first))

    def rope(self, time_s: Real, length_m: Real | float, speed_m_s: Real) -> Rope:
        """Of speeds, shape (count, ...), and the length before the first, shape (...), at times of any shape: (times, ...)."""
        travelled, rate, acceleration = self._sums(
            (time_s[..., None] - self.start_s) / self.step_s - np.arange(self.count)
        )
        return Rope(
            length_m + self.step_s / 6 * travelled @ speed_m_s,
            0.5 * rate @ speed_m_s,
            acceleration @ speed_m_s / self.step_s,
        )

    def near(self, from_s: Real, span_s: float) -> tuple[NDArray[np.intp], int]:
        """The first spline that is felt within `span_s` from each time on, of the same shape, and how many are.

        They may lie outside the raster: then they are 0.
        """
        first = np.floor((from_s - self.start_s) / self.step_s).astype(np.intp) - SUPPORT + 1
        return first, int(np.ceil(span_s / self.step_s)) + SUPPORT

    def rope_near(self, time_s: Real, first: NDArray[np.intp], length_m: Real, speed_m_s: Real) -> Rope:
        """Like `rope`, of few splines each: the first, shape (...), their speeds, (..., few, lanes), the length, (..., lanes)."""
        place = (time_s - self.start_s) / self.step_s - first
        travelled, rate, acceleration = self._sums(place[..., None, None] - np.arange(speed_m_s.shape[-2]))
        return Rope(
            length_m + self.step_s / 6 * (travelled @ speed_m_s)[..., 0, :],
            0.5 * (rate @ speed_m_s)[..., 0, :],
            (acceleration @ speed_m_s)[..., 0, :] / self.step_s,
        )

    def moved(self, other: "SplineGrid", speed_m_s: Real) -> tuple[Real, float]:
        """Speeds, shape (count,), on another raster of the same step, and the way of the splines that end before it.

        Splines that `other` has and this has not are 0.
        """
        shift = round((other.start_s - self.start_s) / self.step_s)
        place = np.arange(other.count) + shift
        inside = (place >= 0) & (place < self.count)
        carried = np.where(inside, speed_m_s[np.clip(place, 0, self.count - 1)], 0.0)
        return carried, float(speed_m_s[: max(shift, 0)].sum()) * self.step_s

    @staticmethod
    def _sums(s: Real) -> tuple[Real, Real, Real]:
        """Truncated powers: 6, 2 and 1 times the spline's integral, itself, its derivative in steps."""
        third, second, first = np.zeros_like(s), np.zeros_like(s), np.zeros_like(s)
        for knot, weight in _BINOMIALS:
            beyond = np.clip(s - knot, 0.0, SUPPORT - knot)
            term = weight * beyond
            first += term
            term *= beyond
            second += term
            term *= beyond
            third += term
        within = s < SUPPORT
        return np.where(within, third, 6.0), np.where(within, second, 0.0), np.where(within, first, 0.0)
