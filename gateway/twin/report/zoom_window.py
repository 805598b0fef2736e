"""The most informative window of a recording: where an event acted, the model improved most, or the residual is largest."""

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.output.estimates import NamedEffect
from gateway.twin.reconcile.output.result import Curves, Disagreement, Reconciliation
from gateway.twin.report.text import is_same_model

Array = NDArray[np.float64]
PERIODS = 3.0
"""Swing periods in a window."""
CYCLES = 12.0
"""Cycles in a window that shows an oscillation faster than the swing."""
FAST = 3.0
"""An oscillation above this many swing frequencies gets a window of its own cycles."""
NARROW = 2.0
"""A band wider than an octave has no cycles to show."""
MIN_SAMPLES = 40


def most_informative_window(result: Reconciliation, curves: Curves) -> tuple[float, float]:
    """Return from and to, in s of the recording."""
    acted = next((effect.when_s for effect in effects_acting_in(result, curves)), None)
    length_s = _length_s(result, curves)
    if acted is not None:
        margin_s = length_s / 2
        return _within(curves, acted[0] - margin_s, acted[1] + margin_s)
    middle_s = _middle_s(curves, length_s, gained=shows_gain(result, curves))
    return _within(curves, middle_s - length_s / 2, middle_s + length_s / 2)


def shows_gain(result: Reconciliation, curves: Curves) -> bool:
    """Return whether the improvement is more informative than the residual: the model changed and explains the data."""
    return result.verdict != "unmodelled" and not is_same_model(curves)


def effects_acting_in(result: Reconciliation, curves: Curves) -> tuple[NamedEffect, ...]:
    """Return the transient effects that acted within the time of the curves.

    Times of effects count from the start of the recording, of which the curves may be a later part.
    """
    first_s, last_s = curves.span_s
    return tuple(
        effect
        for effect in result.effects
        if effect.when_s is not None and effect.when_s[0] < last_s and effect.when_s[1] >= first_s
    )


def _length_s(result: Reconciliation, curves: Curves) -> float:
    strongest = max(result.disagreement, key=lambda each: each.rms_sigma, default=None)
    length_s = PERIODS * result.rig.small_swing_period_s
    if strongest is not None and _is_fast(strongest, result):
        length_s = CYCLES / strongest.band_hz[1]
    step_s = float(np.median(np.diff(curves.time_s)))
    return max(length_s, MIN_SAMPLES * step_s)


def _is_fast(disagreement: Disagreement, result: Reconciliation) -> bool:
    low_hz, high_hz = disagreement.band_hz
    return low_hz * result.rig.small_swing_period_s > FAST and high_hz < NARROW * low_hz


def _middle_s(curves: Curves, length_s: float, *, gained: bool) -> float:
    """Return the middle of the window in which the residual shrank most, or is largest after."""
    after = (curves.residual_after_g / curves.noise_g) ** 2
    wanted = (curves.residual_before_g / curves.noise_g) ** 2 - after if gained else after
    wanted = np.where(curves.used, wanted.sum(axis=1), 0.0)
    samples = min(len(wanted), max(1, int(np.searchsorted(curves.time_s - curves.time_s[0], length_s))))
    sums = np.convolve(wanted, np.ones(samples), mode="valid")
    return float(curves.recording_time_s[int(np.argmax(sums)) + samples // 2])


def _within(curves: Curves, from_s: float, to_s: float) -> tuple[float, float]:
    """Return a window that is moved, not cut, at the ends of the curves."""
    first_s, last_s = curves.span_s
    length_s = min(to_s - from_s, last_s - first_s)
    from_s = min(max(from_s, first_s), last_s - length_s)
    return from_s, from_s + length_s
