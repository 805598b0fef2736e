"""The stretch of a recording that tells most: where an event acted, or where the model changed most, or where it misses most."""

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.output.result import Curves, Disagreement, NamedEffect, Reconciliation
from gateway.twin.report.models import same

Array = NDArray[np.float64]
PERIODS = 3.0
"""Of the swing: a stretch shows a few of them."""
CYCLES = 12.0
"""Of what is quicker than the swing."""
QUICK = 3.0
"""What lies above this many swing frequencies is shown by its own cycles."""
NARROW = 2.0
"""A band wider than an octave has no cycles to show."""
LEAST_SAMPLES = 40


def period_s(result: Reconciliation) -> float:
    """Of the swing that the rig's description gives, small swings."""
    return result.rig.small_swing_period_s


def telling_stretch(result: Reconciliation, curves: Curves) -> tuple[float, float]:
    """From and to, in s."""
    acted = next((effect.when_s for effect in acting_in(result, curves)), None)
    length_s = _length_s(result, curves)
    if acted is not None:
        margin_s = length_s / 2
        return _within(curves, acted[0] - margin_s, acted[1] + margin_s)
    middle_s = _middle_s(curves, length_s, gained=shows_gain(result, curves))
    return _within(curves, middle_s - length_s / 2, middle_s + length_s / 2)


def shows_gain(result: Reconciliation, curves: Curves) -> bool:
    """What changed tells most; where nothing did, or it explains nothing, what is left does."""
    return result.verdict != "unmodelled" and not same(curves)


def acting_in(result: Reconciliation, curves: Curves) -> tuple[NamedEffect, ...]:
    """Effects that acted for a time, inside a recording."""
    last_s = float(curves.time_s[-1])
    return tuple(effect for effect in result.effects if effect.when_s is not None and effect.when_s[0] < last_s)


def _length_s(result: Reconciliation, curves: Curves) -> float:
    strongest = max(result.disagreement, key=lambda each: each.rms_sigma, default=None)
    length_s = PERIODS * period_s(result)
    if strongest is not None and _is_quick(strongest, result):
        length_s = CYCLES / strongest.band_hz[1]
    step_s = float(np.median(np.diff(curves.time_s)))
    return max(length_s, LEAST_SAMPLES * step_s)


def _is_quick(disagreement: Disagreement, result: Reconciliation) -> bool:
    low_hz, high_hz = disagreement.band_hz
    return low_hz * period_s(result) > QUICK and high_hz < NARROW * low_hz


def _middle_s(curves: Curves, length_s: float, *, gained: bool) -> float:
    """Middle of the stretch where the residual shrank most, or is largest after."""
    after = (curves.residual_after_g / curves.noise_g) ** 2
    wanted = (curves.residual_before_g / curves.noise_g) ** 2 - after if gained else after
    wanted = np.where(curves.used, wanted.sum(axis=1), 0.0)
    samples = min(len(wanted), max(1, int(np.searchsorted(curves.time_s - curves.time_s[0], length_s))))
    sums = np.convolve(wanted, np.ones(samples), mode="valid")
    return float(curves.time_s[int(np.argmax(sums)) + samples // 2])


def _within(curves: Curves, from_s: float, to_s: float) -> tuple[float, float]:
    """Moved, not cut, at the ends of the recording."""
    first, last = float(curves.time_s[0]), float(curves.time_s[-1])
    length_s = min(to_s - from_s, last - first)
    from_s = min(max(from_s, first), last - length_s)
    return from_s, from_s + length_s
