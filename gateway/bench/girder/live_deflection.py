"""Deflection of a girder from the tilt messages of two live gateways, as they arrive."""

from collections import deque
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gateway.bench.girder.deflection import (
    DEFLECTION_AVERAGE_S,
    Deflection,
    EndRotation,
    Girder,
    InwardAxis,
    girder_deflection,
    inward_tilt_rad,
)
from gateway.messages import Tilt

Side = Literal["left", "right"]
MAX_AVERAGED_TILTS = 64
"""Largest number of tilts of an average, which bounds memory. Basis: a choice; an average has ten at ten tilts per second; six
times as many bound the memory."""
MIN_AVERAGED_TILTS = 5
"""Fewest tilts of an average. Basis: a choice; half of what comes in `DEFLECTION_AVERAGE_S`."""
MAX_APART_S = 1.0
"""Largest difference between the newest tilts of both ends, s; beyond it one of them is stale, or the clocks differ. Basis: a
choice; ten tilts, and one average."""


@dataclass(frozen=True, slots=True)
class DeflectionReadout:
    """What a person sees: the deflection, or why there is none."""

    deflection: Deflection | None
    text: str
    """The reason; empty with a deflection."""


@dataclass(slots=True)
class _LiveEnd:
    axis: InwardAxis
    u_relative: float
    recent: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=MAX_AVERAGED_TILTS))
    """Time, ns, and tilt, rad, of the newest trusted tilts."""
    zero: list[float] = field(default_factory=list)
    zero_begin_ns: int | None = None
    reason: str = "no tilt yet"

    def add(self, tilt: Tilt, zero_s: float) -> None:
        """Add a message: to the zero while that lasts, then to the average."""
        if not tilt.trusted or tilt.specific_force_g is None:
            self.recent.clear()
            self.reason = "the reading is not trusted: it moves or vibrates"
            return
        angle_rad = float(inward_tilt_rad(np.array(tilt.specific_force_g), self.axis))
        self.reason = ""
        if self.zero_begin_ns is None:
            self.zero_begin_ns = tilt.time_ns
        if tilt.time_ns - self.zero_begin_ns <= zero_s * 1e9:
            self.zero.append(angle_rad)
        self.recent.append((tilt.time_ns, angle_rad))
        while tilt.time_ns - self.recent[0][0] > DEFLECTION_AVERAGE_S * 1e9:
            self.recent.popleft()

    def rotation(self) -> EndRotation:
        """Return the mean rotation; an average of correlated tilts is taken to be no better than one of them."""
        scatter_rad = float(np.std(self.zero, ddof=1))
        u_rad = float(np.hypot(scatter_rad, scatter_rad / np.sqrt(max(len(self.zero) / 10, 1))))
        mean_rad = float(np.mean([angle_rad for _, angle_rad in self.recent]))
        return EndRotation(float(np.mean(self.zero)) - mean_rad, u_rad, self.u_relative)


class LiveDeflection:
    """Collects a zero from both ends, then gives the deflection with each tilt."""

    def __init__(
        self,
        girder: Girder,
        axes: tuple[InwardAxis, InwardAxis],
        u_relative: tuple[float, float],
        zero_s: float,
    ) -> None:
        self._girder = girder
        self._zero_s = zero_s
        self._ends: dict[Side, _LiveEnd] = {
            "left": _LiveEnd(axes[0], u_relative[0]),
            "right": _LiveEnd(axes[1], u_relative[1]),
        }

    def add(self, side: Side, tilt: Tilt) -> DeflectionReadout:
        """Return the deflection after this tilt of one end."""
        self._ends[side].add(tilt, self._zero_s)
        for name, end in self._ends.items():
            if end.reason or not end.recent:
                return DeflectionReadout(None, f"{name} end: {end.reason or 'no tilt yet'}")
        newest_ns = [end.recent[-1][0] for end in self._ends.values()]
        if max(newest_ns) - min(newest_ns) > MAX_APART_S * 1e9:
            return DeflectionReadout(None, f"the ends are {(max(newest_ns) - min(newest_ns)) / 1e9:.1f} s apart")
        if not all(self._has_zero(end) for end in self._ends.values()):
            return DeflectionReadout(None, f"zero: keep the girder unloaded for {self._zero_s:g} s")
        if min(len(end.recent) for end in self._ends.values()) < MIN_AVERAGED_TILTS:
            return DeflectionReadout(None, "wait: the angles are being averaged")
        left, right = (end.rotation() for end in self._ends.values())
        return DeflectionReadout(girder_deflection(left, right, self._girder), "")

    def _has_zero(self, end: _LiveEnd) -> bool:
        if end.zero_begin_ns is None or len(end.zero) < MIN_AVERAGED_TILTS:
            return False
        return end.recent[-1][0] - end.zero_begin_ns > self._zero_s * 1e9
