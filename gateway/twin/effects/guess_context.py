"""What the initial guesses of an effect are computed from, and those of events.

A fit is not convex in times, so the times of events come from changepoints and scanned windows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.parameter import Values

Array = NDArray[np.float64]
SHARPEST = 0.01
"""The smallest fraction of an event in which it rises and falls. Basis: edges this sharp lie between two samples."""
GUST_WIDENING = 1.5
"""Duration of a gust over that of the window in which the scan finds it. Basis: the ramps are too weak to be found."""
GUST_RAMP_FRACTION = 0.5
"""Initial fraction of a gust in which it rises and falls. Basis: between a smooth gust (1) and a pull with sharp edges (0)."""
RAMP_SHARES_BETWEEN_CHANGEPOINTS = (0.2, 0.28, 0.36)
"""Initial durations of each of the two ramps of a drive, over the time between the changepoints."""
RAMP_SHARE_IN_WINDOW = 0.25
"""The same for a scanned window."""
IMPACT_INTERVAL_S = 1.5
"""Longest time between the changepoints of an impact. Basis: each side needs half a second of samples."""
IMPACT_SPACING_S = 0.15
"""Spacing of the instants from which a fit finds an impact."""
OFF_GRID_S = 0.013
"""Shift that keeps the edges of an event between the samples."""
MIN_GUESS_S = 2.0
"""Shortest event that is guessed from a window."""


@dataclass(frozen=True, slots=True)
class EventWindow:
    """An interval outside which the load swings freely."""

    from_s: float
    to_s: float
    remaining_chi2: float
    """Chi-square with separate motions before and after the interval; samples inside it count as noise."""


@dataclass(frozen=True, slots=True)
class GuessContext:
    """A recording of n samples, the residual of the model so far, and the intervals in which an event may have acted."""

    length_m: float
    """Nominal length of the rope."""
    gravity_m_s2: float
    time_s: Array
    """Since the first sample, shape (n,)."""
    force_g: Array
    """Measured specific force, shape (n, 3)."""
    noise_g: Array
    """Standard deviation of the noise of each axis, shape (3,)."""
    residual_g: Array
    """Measured minus simulated by the model so far, shape (n, 3)."""
    windows: tuple[EventWindow, ...] = ()
    """Results of the changepoint scan, in order of increasing maximum length."""
    changepoints: EventWindow | None = None
    """The interval between the motion before an event and the motion after it; more reliable than the windows."""

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])


def guess_event(
    context: GuessContext, start: Sequence[str], durations: Sequence[str], edges: Sequence[str]
) -> list[Values]:
    """Return guesses for an event by the names of its parameters: for an instant, for a pulse, or for a sequence of parts."""
    if not durations:
        return [dict.fromkeys(start, values["start_s"]) for values in guess_impact(context)]
    found: list[Values] = []
    for pulse in guess_pulse(context):
        times: dict[str, float | tuple[float, ...]] = dict.fromkeys(start, pulse["start_s"])
        times |= {name: float(np.asarray(pulse["duration_s"])) / len(durations) for name in durations}
        times |= {name: pulse["rising_share"] for name in edges if "rising_share" in pulse}
        found += [times] if times not in found else []
    return found


def guess_impact(context: GuessContext) -> list[Values]:
    """Return instants around the changepoint, the nearest first, then the middles of the short windows."""
    found: list[Values] = []
    between = context.changepoints
    if between is not None and between.to_s - between.from_s < IMPACT_INTERVAL_S:
        at_s = np.arange(between.from_s - IMPACT_INTERVAL_S / 2, between.to_s, IMPACT_SPACING_S) + OFF_GRID_S
        nearest = np.argsort(np.abs(at_s - between.from_s), kind="stable")
        found = [{"start_s": float(each)} for each in at_s[nearest]]
    return found + [{"start_s": (w.from_s + w.to_s) / 2 + OFF_GRID_S} for w in context.windows[:2]]


def guess_gust(context: GuessContext) -> list[Values]:
    """Return a pulse between the changepoints, and longer ones around the middles of the windows."""
    found = [_pulse_in(window, GUST_WIDENING) for window in context.windows[1:3]]
    if context.changepoints is not None:
        found.insert(0, _pulse_in(context.changepoints))
    return [{**values, "rising_share": GUST_RAMP_FRACTION} for values in found]


def guess_pulse(context: GuessContext) -> list[Values]:
    """Return pulses between the changepoints with the usual and with sharp edges, and sharp ones in the windows."""
    sharp: list[Values] = [{**_pulse_in(window), "rising_share": SHARPEST} for window in context.windows[1:]]
    if context.changepoints is None:
        return sharp
    between = _pulse_in(context.changepoints)
    return [between, {**between, "rising_share": SHARPEST}, *sharp]


def guess_trapezoid(context: GuessContext) -> list[Values]:
    """Return drives of two ramps with constant speed between them: several between the changepoints, one in each window."""
    found = [_trapezoid_in(window, RAMP_SHARE_IN_WINDOW) for window in context.windows[2:]]
    if context.changepoints is None:
        return found
    return [_trapezoid_in(context.changepoints, share) for share in RAMP_SHARES_BETWEEN_CHANGEPOINTS] + found


def _trapezoid_in(window: EventWindow, ramp_share: float) -> Values:
    length_s = max(window.to_s - window.from_s, MIN_GUESS_S)
    return {
        "start_s": window.from_s + OFF_GRID_S,
        "duration_s": ramp_share * length_s,
        "coast_s": (1 - 2 * ramp_share) * length_s,
    }


def _pulse_in(window: EventWindow, widening: float = 1.0) -> Values:
    middle_s, length_s = (window.from_s + window.to_s) / 2, widening * max(window.to_s - window.from_s, MIN_GUESS_S)
    return {"start_s": middle_s - length_s / 2 + OFF_GRID_S, "duration_s": length_s}
