"""A rope whose length changes: its length over time by a spline whose coefficients are unknowns of the fit.

The speed L' is a sum of quadratic B-splines on a uniform grid of knots (de Boor 1978). It has no jump, nor has the acceleration;
outside the grid the rope stands still; any drive that ramps over more than one step can be represented. Length and acceleration
are the exact integral and derivative.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

SPLINE_SUPPORT_STEPS = 3
"""Number of grid steps over which a quadratic B-spline is not zero. Definition: order of the spline plus one."""
_SIGNED_BINOMIALS = ((0, 1.0), (1, -3.0), (2, 3.0), (3, -1.0))


@dataclass(frozen=True, slots=True)
class RopeLengthSpline:
    """Length of the rope and its two derivatives at some times; arrays of one shape."""

    length_m: Array
    rate_m_s: Array
    acceleration_m_s2: Array


@dataclass(frozen=True, slots=True)
class SplineGrid:
    """Grid of the splines: number k is zero before `start_s + k step_s` and again three steps later."""

    start_s: float
    step_s: float
    count: int

    @classmethod
    def covering(cls, from_s: float, to_s: float, step_s: float) -> "SplineGrid":
        """Return the grid of all splines that are not zero somewhere in between; grids of one step share their knots."""
        first, last = np.floor(from_s / step_s) - SPLINE_SUPPORT_STEPS + 1, np.ceil(to_s / step_s)
        return cls(float(first * step_s), step_s, int(last - first))

    def evaluate(self, time_s: Array, length_m: Array | float, speed_m_s: Array) -> RopeLengthSpline:
        """Return the rope at times of any shape, (times, ...), for speeds (count, ...) and the length before the first, (...)."""
        travelled, rate, acceleration = self._basis(
            (time_s[..., None] - self.start_s) / self.step_s - np.arange(self.count)
        )
        return RopeLengthSpline(
            length_m + self.step_s / 6 * travelled @ speed_m_s,
            0.5 * rate @ speed_m_s,
            acceleration @ speed_m_s / self.step_s,
        )

    def local_splines(self, from_s: Array, duration_s: float) -> tuple[NDArray[np.intp], int]:
        """Return the first spline that is not zero within a duration from each time on, and how many such splines there are.

        They may lie outside the grid, where their coefficients are zero.
        """
        first = np.floor((from_s - self.start_s) / self.step_s).astype(np.intp) - SPLINE_SUPPORT_STEPS + 1
        return first, int(np.ceil(duration_s / self.step_s)) + SPLINE_SUPPORT_STEPS

    def evaluate_local(
        self, time_s: Array, first: NDArray[np.intp], length_m: Array, speed_m_s: Array
    ) -> RopeLengthSpline:
        """Return the rope from a few splines for each time: first (...), speeds (..., few, variants), length (..., variants)."""
        place = (time_s - self.start_s) / self.step_s - first
        travelled, rate, acceleration = self._basis(place[..., None, None] - np.arange(speed_m_s.shape[-2]))
        return RopeLengthSpline(
            length_m + self.step_s / 6 * (travelled @ speed_m_s)[..., 0, :],
            0.5 * (rate @ speed_m_s)[..., 0, :],
            (acceleration @ speed_m_s)[..., 0, :] / self.step_s,
        )

    def transfer(self, other: "SplineGrid", speed_m_s: Array) -> tuple[Array, float]:
        """Return the speeds (count,) on another grid of the same step, and the length that the splines before it add.

        Splines that only `other` has are zero.
        """
        shift = round((other.start_s - self.start_s) / self.step_s)
        place = np.arange(other.count) + shift
        inside = (place >= 0) & (place < self.count)
        transferred = np.where(inside, speed_m_s[np.clip(place, 0, self.count - 1)], 0.0)
        return transferred, float(speed_m_s[: max(shift, 0)].sum()) * self.step_s

    @staticmethod
    def _basis(s: Array) -> tuple[Array, Array, Array]:
        """Return 6, 2 and 1 times a spline's integral, value and derivative at `s` steps behind its first knot."""
        third, second, first = np.zeros_like(s), np.zeros_like(s), np.zeros_like(s)
        for knot, weight in _SIGNED_BINOMIALS:  # truncated powers
            beyond = np.clip(s - knot, 0.0, SPLINE_SUPPORT_STEPS - knot)
            term = weight * beyond
            first += term
            term *= beyond
            second += term
            term *= beyond
            third += term
        within = s < SPLINE_SUPPORT_STEPS
        return np.where(within, third, 6.0), np.where(within, second, 0.0), np.where(within, first, 0.0)
