"""The lines of a residual as multiples of the swing's own frequency, which say where a cause is to be sought.

A reading that is not linear in what it measures has lines at two to four times the swing's frequency; so has a body that rocks.
"""

import numpy as np

from gateway.numerics.spectrum import periodogram
from gateway.twin.reconcile.output.result import Curves, Peak, Reconciliation

NEAR_RIG = 1.6
"""Factor within which the swing's frequency is that of the rig: beyond it a recording is refused."""
MAX_MULTIPLE = 4
"""Largest multiple that is named."""
SAME_LINE_CYCLES = 1.5
"""Cycles in the recording by which two frequencies may differ and yet be one line."""
MULTIPLES = ("", "twice ", "three times ", "four times ")
HINT = (
    "lines at multiples of the swing's frequency are typical of a reading that is not linear (an angle sensor, the "
    "perspective of a camera) or of a load that rocks in its slings"
)


def multiple_of_swing(peak: Peak, result: Reconciliation) -> int | None:
    """Return which multiple of the swing's frequency a line is at, 1 to `MAX_MULTIPLE`; None where it is at none."""
    if result.log is None:
        return None
    swing_hz, resolution_hz = _swing_hz(result.log, 1 / result.rig.small_swing_period_s), _resolution_hz(result.log)
    multiple = round(peak.hz / swing_hz)
    is_at = 1 <= multiple <= MAX_MULTIPLE and abs(peak.hz - multiple * swing_hz) < resolution_hz
    return multiple if is_at else None


def name_multiple(peak: Peak, result: Reconciliation) -> str:
    """Return at which multiple of the swing's frequency a line is, after a comma; nothing where it is at none."""
    multiple = multiple_of_swing(peak, result)
    return "" if multiple is None else f", {MULTIPLES[multiple - 1]}the swing's frequency"


def suggests_other_reading(result: Reconciliation) -> bool:
    """Whether the strongest line of what is left is at a multiple of the swing's frequency beyond the first."""
    peaks = () if result.residual is None else result.residual.peaks
    return bool(peaks) and (multiple_of_swing(peaks[0], result) or 1) > 1


def _swing_hz(log: Curves, rig_hz: float) -> float:
    """Return the frequency of the strongest line across the rope near that of the rig; at the load, where none is, the rig's."""
    frequency_hz, power = periodogram(log.time_s, log.measured_g / log.noise_g)
    near = (frequency_hz > rig_hz / NEAR_RIG) & (frequency_hz < rig_hz * NEAR_RIG)
    across = power[near, :2].sum(axis=1)
    return (
        float(frequency_hz[near][np.argmax(across)])
        if across.size and across.max() > len(log.time_s) ** 0.5
        else rig_hz
    )


def _resolution_hz(log: Curves) -> float:
    return SAME_LINE_CYCLES / float(log.time_s[-1] - log.time_s[0])
