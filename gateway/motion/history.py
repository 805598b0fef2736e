"""The motion of the rope over a recording, and the phases of the crane's work in it."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from gateway.motion.estimate import MotionState
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975

SHORTEST_PHASE_S = 1.0
"""A shorter phase belongs to its neighbours, unless it is the only one."""
LONGEST_GAP_S = 2.0
"""Time without a bin that ends a phase. Basis: live, the motion is unknown a second and a half after the newest bin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LargestAngle:
    """The largest angle of a time span, with its coverage interval of 95 %."""

    time_s: float
    angle_rad: float
    u_rad: float
    coverage95_rad: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionPhase:
    """A time span in which crane and load do the same."""

    state: MotionState
    from_s: float
    to_s: float
    largest: LargestAngle | None
    """None: the angle is not known at any time of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionHistory:
    """The motion at each bin, arrays of shape (n,) where nothing else is said; what is not known is NaN."""

    time_s: Array
    angle_rad: Array
    """Between rope and vertical."""
    u_rad: Array
    azimuth_rad: Array
    """Side to which the load hangs, in the housing frame, from x towards y."""
    rate_rad_s: Array
    """Time derivative of the angle."""
    pivot_acceleration_m_s2: Array
    """Horizontal, in the housing frame, shape (n, 2)."""
    pivot_acceleration_u_m_s2: Array
    hoist_m_s: Array
    """Rate of the rope's length, lowering positive."""
    hoist_u_m_s: Array
    length_m: Array
    length_u_m: Array
    probabilities: Array
    """Of the hypotheses, in the order of `gateway.motion.hypotheses`, shape (n, m)."""
    state: tuple[MotionState, ...]

    @classmethod
    def join(cls, parts: "list[Self]") -> Self:
        """Return consecutive parts as one."""
        arrays = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(cls)
            if field.name != "state"
        }
        return cls(**arrays, state=tuple(state for part in parts for state in part.state))

    def between(self, from_s: float, to_s: float) -> Self:
        """Return the bins from a time to a later one, both included."""
        begin, end = np.searchsorted(self.time_s, [from_s, np.nextafter(to_s, np.inf)]).tolist()
        return type(self)(**{field.name: getattr(self, field.name)[begin:end] for field in fields(self)})

    def largest_angle(self, begin: int = 0, end: int | None = None) -> LargestAngle | None:
        """Return the largest angle of some bins; its interval also reaches to any other time's upper end."""
        known = begin + np.flatnonzero(np.isfinite(self.angle_rad[begin:end]))
        if len(known) == 0:
            return None
        angle_rad, u_rad = self.angle_rad[known], self.u_rad[known]
        top = int(angle_rad.argmax())
        time_s, summit_rad = self._summit(int(known[top]))
        reach_rad = NORMAL_975 * u_rad
        low_rad = max(float((angle_rad - reach_rad).max()), 0.0)
        high_rad = max(summit_rad + float(reach_rad[top]), float((angle_rad + reach_rad).max()))
        return LargestAngle(
            time_s=time_s, angle_rad=summit_rad, u_rad=float(u_rad[top]), coverage95_rad=(low_rad, high_rad)
        )

    def _summit(self, top: int) -> tuple[float, float]:
        """Return time and height of the parabola through a maximum and its neighbours."""
        at = slice(top - 1, top + 2)
        if top == 0 or top == len(self.time_s) - 1 or not np.isfinite(self.angle_rad[at]).all():
            return float(self.time_s[top]), float(self.angle_rad[top])
        time_s = self.time_s[at] - self.time_s[top]
        curvature, slope, height_rad = np.polyfit(time_s, self.angle_rad[at], 2).tolist()
        shift_s = -slope / (2 * curvature) if curvature < 0 else 0.0
        if not time_s[0] <= shift_s <= time_s[2]:
            return float(self.time_s[top]), float(self.angle_rad[top])
        return float(self.time_s[top] + shift_s), float(height_rad + 0.5 * slope * shift_s)

    def phases(self) -> tuple[MotionPhase, ...]:
        """Return the phases in order of time."""
        if not self.state:
            return ()
        begins = _phase_begins(self.time_s, self.state)
        ends = [*list(begins)[1:], len(self.state)]
        step_s = np.diff(self.time_s, append=self.time_s[-1])
        return tuple(
            MotionPhase(
                state=state,
                from_s=float(self.time_s[begin]),
                to_s=float(self.time_s[end - 1] + (step_s[end - 1] if step_s[end - 1] <= LONGEST_GAP_S else 0.0)),
                largest=self.largest_angle(begin, end),
            )
            for (begin, state), end in zip(begins.items(), ends, strict=True)
        )


def _phase_begins(time_s: Array, states: tuple[MotionState, ...]) -> dict[int, MotionState]:
    """Return the first bin of each phase with its state; a short run of another state belongs to the phase before it.

    Behind a gap begins a phase of its own.
    """
    gaps = {0, *(np.flatnonzero(np.diff(time_s) > LONGEST_GAP_S) + 1).tolist()}
    changes = [i for i in range(len(states)) if i in gaps or states[i] != states[i - 1]]
    ends_s = [*time_s[changes[1:]], time_s[-1]]
    found: dict[int, MotionState] = {}
    for first, end_s in zip(changes, ends_s, strict=True):
        is_short = end_s - time_s[first] < SHORTEST_PHASE_S
        newest = next(reversed(found.values()), None)
        if first in gaps or (not is_short and states[first] != newest):
            found[first] = states[first]
    return found
