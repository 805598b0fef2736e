"""Whether a reading can be trusted: named gates on the last seconds (001 section 3).

The norm gate (001 eq. 15) is necessary and not sufficient: constant accelerations exist that leave |m| = 1 (001 Fig. 2), and
no accelerometer alone can see them. The gates on stillness, impact and pendulum consistency narrow what it lets through.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.messages import Verdict

Array = NDArray[np.float64]
WINDOW_S = 2.0
BIN_S = 0.1
FEWEST_BINS = 10
STILL_SIGMA = 5.0
"""A still housing keeps its bin means within this many standard deviations of each other, beyond the floor."""
STILL_FLOOR_G = 0.0015
"""Peak-to-peak of the bin means that still counts as still: 0.05 degrees of lean either way."""
ROUGH_FACTOR = 4.0
"""Scatter within a bin of more than this many times the noise is vibration."""
ROUGH_FLOOR_G = 0.004
IMPACT_G = 0.25
"""A single sample this far from its bin's mean is an impact."""
LOST_SHARE = 0.1
WIDEST_RAD = np.radians(30.0)
"""While the swing is not known yet, a hanging load is given as much as this."""


@dataclass(frozen=True, slots=True)
class SwingSeen:
    """What the swing stage says of the same stretch."""

    swinging: bool | None
    phi_max_rad: float | None
    consistent: bool
    """A pendulum explains the motion."""
    rho: float | None = None
    """Where on the rope the housing hangs, by the period; None: as far down as it can be."""


@dataclass(frozen=True, slots=True)
class ConditionFound:
    """The verdict with its gates."""

    verdict: Verdict
    trusted: bool
    reasons: tuple[str, ...]
    gates: dict[str, bool]
    norm_g: float | None


@dataclass(frozen=True, slots=True)
class _Bin:
    mean: Array
    scatter_g: float
    peak_g: float
    count: int
    clipped: int
    missing: int


class ConditionWatch:
    """Keeps the last seconds as bins, and judges them."""

    def __init__(self, noise_g: float | None, permissible_norm_error_g: float) -> None:
        self._noise_g = noise_g
        self._dm_g = permissible_norm_error_g
        self._bins: deque[_Bin] = deque(maxlen=round(WINDOW_S / BIN_S))
        self._open: list[Array] = []
        self._open_since_s: float | None = None
        self._last_s: float | None = None
        self._clipped = 0
        self._missing = 0

    def update(self, time_s: Array, force_g: Array, clipped: int, missing: int) -> None:
        """Take a block: times (n,), specific force (n, 3), how many samples were clipped or are missing."""
        self._clipped += clipped
        self._missing += missing
        if self._last_s is not None and time_s[0] - self._last_s > WINDOW_S:
            self._bins.clear()  # what was before a gap longer than the window says nothing about now
            self._open, self._open_since_s = [], None
        self._last_s = float(time_s[-1])
        if self._open_since_s is None:
            self._open_since_s = float(time_s[0])
        self._open.append(force_g)
        if time_s[-1] - self._open_since_s >= BIN_S:
            self._close_bin()

    def _close_bin(self) -> None:
        force_g = np.concatenate(self._open)
        mean = force_g.mean(axis=0)
        away = np.abs(force_g - mean)
        scatter_g = float(np.sqrt((away**2).mean()))
        self._bins.append(_Bin(mean, scatter_g, float(away.max()), len(force_g), self._clipped, self._missing))
        self._open, self._open_since_s, self._clipped, self._missing = [], None, 0, 0

    def judge(self, swing: SwingSeen) -> ConditionFound:
        """The verdict on the window."""
        if len(self._bins) < FEWEST_BINS:
            return ConditionFound("unknown", False, ("less than a second of data",), {"enough_data": False}, None)
        gates = self._gates(swing)
        norm_g = float(np.linalg.norm(np.mean([b.mean for b in self._bins], axis=0)))
        verdict, reasons = _verdict(gates, swing)
        trusted = verdict in ("static", "quasi_static", "swinging")
        return ConditionFound(verdict, trusted, tuple(reasons), gates, norm_g)

    def _gates(self, swing: SwingSeen) -> dict[str, bool]:
        means = np.array([b.mean for b in self._bins])
        norms = np.linalg.norm(means, axis=1)
        scatter_g = float(np.median([b.scatter_g for b in self._bins]))
        noise_g = self._noise_g if self._noise_g is not None else min(b.scatter_g for b in self._bins)
        per_bin = float(np.mean([b.count for b in self._bins]))
        spread_g = float(np.ptp(means, axis=0).max())
        widest_rad = WIDEST_RAD if swing.phi_max_rad is None else swing.phi_max_rad
        span = 1 - np.cos(widest_rad)
        rho = 1.0 if swing.rho is None else swing.rho
        received = sum(b.count for b in self._bins)
        return {
            "enough_data": True,
            "complete": sum(b.missing for b in self._bins) <= LOST_SHARE * received,
            "not_clipped": not any(b.clipped for b in self._bins),
            "no_impact": max(b.peak_g for b in self._bins) < IMPACT_G + 6 * noise_g,
            "axes_alive": bool(np.all(np.abs(means).max(axis=0) > 0)),
            "still": spread_g < STILL_FLOOR_G + STILL_SIGMA * scatter_g / np.sqrt(per_bin),
            "quiet": scatter_g < max(ROUGH_FACTOR * noise_g, ROUGH_FLOOR_G),
            "norm_static": bool(np.all(np.abs(norms - 1) < self._dm_g)),
            "norm_pendulum": bool(
                np.all(norms > 1 - span - self._dm_g) and np.all(norms < 1 + 2 * rho * span + self._dm_g)
            ),
            "pendulum": swing.consistent and bool(swing.swinging),
        }


UNUSABLE = {
    "complete": "more than a tenth of the samples is missing",
    "axes_alive": "an axis reads exactly zero",
}
DISTURBING = {
    "not_clipped": "clipped: a reading reached full scale",
    "no_impact": "impact: a sample far off its neighbours",
    "norm_pendulum": "the magnitude is not that of a hanging load",
}


def _verdict(gates: dict[str, bool], swing: SwingSeen) -> tuple[Verdict, list[str]]:
    """From gates to verdict; the reasons name the gates that decided."""
    if unusable := [text for gate, text in UNUSABLE.items() if not gates[gate]]:
        return "unknown", unusable
    if disturbed := [text for gate, text in DISTURBING.items() if not gates[gate]]:
        return "disturbed", disturbed
    if gates["pendulum"]:
        return "swinging", ["moves as a pendulum does"]
    return _without_swing(gates, swing)


def _without_swing(gates: dict[str, bool], swing: SwingSeen) -> tuple[Verdict, list[str]]:
    if gates["still"] and gates["norm_static"] and gates["quiet"]:
        return "static", ["still, and the magnitude is 1 g"]
    if gates["still"] and gates["norm_static"]:
        return "quasi_static", ["vibrating about a steady mean of 1 g"]
    if swing.swinging is None:
        return "unknown", ["moving; not yet a full swing to judge by"]
    return "disturbed", ["moves as no pendulum does"]
