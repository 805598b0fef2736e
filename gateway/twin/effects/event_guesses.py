"""Initial guesses of events: fits are not convex in times, so the times come from the changepoints and scanned windows."""

from collections.abc import Mapping

import numpy as np

from gateway.twin.effects.guess_context import EventWindow, GuessContext
from gateway.twin.effects.pulse_shape import SHARPEST

Values = Mapping[str, float]
GUST_WIDENING = 1.5
"""A gust over the window that the scan finds: its flanks are too weak to be found."""
GUST_EDGE = 0.5
"""Share of a gust in which it rises and falls: between one that swells all the time and a pull with sharp edges."""
RAMPS_BETWEEN_CHANGEPOINTS = (0.2, 0.28, 0.36)
"""Share of a drive that is each of its two ramps, tried in turn."""
RAMP_IN_WINDOW = 0.25
"""The same where only a window is known."""
IMPACT_INTERVAL_S = 1.5
"""Changepoints of an impact are no further apart: half a second of either side is needed to see them."""
IMPACT_SPACING_S = 0.15
"""How near a fit must begin to find the instant of an impact."""
OFF_GRID_S = 0.013
"""Shift that keeps the edges of an event off the samples."""
MIN_GUESS_S = 2.0
"""Shortest event that is guessed from a window."""


def guess_impact(context: GuessContext) -> list[Values]:
    """Return instants about the changepoint, nearest first, and the middles of the short windows."""
    found: list[Values] = []
    between = context.changepoints
    if between is not None and between.to_s - between.from_s < IMPACT_INTERVAL_S:
        at_s = np.arange(between.from_s - IMPACT_INTERVAL_S / 2, between.to_s, IMPACT_SPACING_S) + OFF_GRID_S
        nearest = np.argsort(np.abs(at_s - between.from_s), kind="stable")
        found = [{"start_s": float(each)} for each in at_s[nearest]]
    return found + [{"start_s": (w.from_s + w.to_s) / 2 + OFF_GRID_S} for w in context.windows[:2]]


def guess_gust(context: GuessContext) -> list[Values]:
    """Return pulses between the changepoints, and longer ones about the windows' middles."""
    found = [_pulse_in(window, GUST_WIDENING) for window in context.windows[1:3]]
    if context.changepoints is not None:
        found.insert(0, _pulse_in(context.changepoints))
    return [{**values, "rising_share": GUST_EDGE} for values in found]


def guess_pulse(context: GuessContext) -> list[Values]:
    """Return pulses from changepoint to changepoint and over the windows, with soft edges and with sharp ones."""
    sharp: list[Values] = [{**_pulse_in(window), "rising_share": SHARPEST} for window in context.windows[1:]]
    if context.changepoints is None:
        return sharp
    between = _pulse_in(context.changepoints)
    return [between, {**between, "rising_share": SHARPEST}, *sharp]


def guess_trapezoid(context: GuessContext) -> list[Values]:
    """Return drives of two ramps and a run: several ramps between the changepoints, one in each window."""
    found = [_trapezoid_in(window, RAMP_IN_WINDOW) for window in context.windows[2:]]
    if context.changepoints is None:
        return found
    return [_trapezoid_in(context.changepoints, ramp) for ramp in RAMPS_BETWEEN_CHANGEPOINTS] + found


def _trapezoid_in(window: EventWindow, ramp: float) -> Values:
    length_s = max(window.to_s - window.from_s, MIN_GUESS_S)
    return {
        "start_s": window.from_s + OFF_GRID_S,
        "duration_s": ramp * length_s,
        "coast_s": (1 - 2 * ramp) * length_s,
    }


def _pulse_in(window: EventWindow, widening: float = 1.0) -> Values:
    middle_s, length_s = (window.from_s + window.to_s) / 2, widening * max(window.to_s - window.from_s, MIN_GUESS_S)
    return {"start_s": middle_s - length_s / 2 + OFF_GRID_S, "duration_s": length_s}
