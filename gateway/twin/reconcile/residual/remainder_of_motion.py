"""The remainder of the motion: the residual of the final model in the swing's own directions and frequency."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import periodogram
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.estimates import DIRECTIONS, Remainder
from gateway.twin.reconcile.output.result import Curves, Peak, Residual
from gateway.twin.reconcile.residual.whiteness import find_peaks

Array = NDArray[np.float64]
NEAR_RIG = 1.6
"""Factor within which the swing's frequency is that of the rig: beyond it a recording is refused."""
MAX_MULTIPLE = 4
"""Largest multiple of the swing's frequency that is named."""
SAME_LINE_CYCLES = 1.5
"""Cycles in the recording by which two frequencies may differ and yet be one line."""
BLOCKS_PER_PERIOD = 2.0
"""Blocks by whose size a swing is told to be wide or small: half a period each."""


def describe_remainder(log: Curves, rig: TwinRig) -> Remainder:
    """Describe what the final model leaves in the log."""
    used = log.used
    noise_power = float((log.noise_g**2).sum())
    motion = log.measured_g[used] - log.measured_g[used].mean(axis=0)
    before, after = log.residual_before_g[used], log.residual_after_g[used]
    wide = _is_wide(log.time_s[used], motion, rig.small_swing_period_s)
    turned = after @ _swing_axes(motion[:, :2])
    swing_hz = swing_frequency_hz(log, rig)
    axis = int(np.argmax((turned**2).sum(axis=0)))
    direction, peak = DIRECTIONS[axis], _strongest_line(log, turned, axis)
    return Remainder(
        share=_share(after, motion, noise_power),
        share_before=_share(before, motion, noise_power),
        share_wide=_share(after[wide], motion[wide], noise_power),
        share_small=_share(after[~wide], motion[~wide], noise_power),
        direction=direction,
        hz=None if peak is None else peak.hz,
        amplitude_g=None if peak is None else peak.amplitude_g,
        multiple=None if peak is None else multiple_of_swing(peak.hz, swing_hz, log),
        is_slow=peak is not None and peak.hz < swing_hz / 2,
    )


def name_multiples(residual: Residual, log: Curves, rig: TwinRig) -> Residual:
    """Return a residual whose lines say at which multiple of the swing's frequency they are."""
    swing_hz = swing_frequency_hz(log, rig)
    peaks = tuple(replace(peak, multiple=multiple_of_swing(peak.hz, swing_hz, log)) for peak in residual.peaks)
    return replace(residual, peaks=peaks)


def multiple_of_swing(hz: float, swing_hz: float, log: Curves) -> int | None:
    """Return which multiple of the swing's frequency a line is at, 1 to `MAX_MULTIPLE`; None where it is at none."""
    multiple = round(hz / swing_hz)
    resolution_hz = SAME_LINE_CYCLES / float(log.time_s[-1] - log.time_s[0])
    return multiple if 1 <= multiple <= MAX_MULTIPLE and abs(hz - multiple * swing_hz) < resolution_hz else None


def swing_frequency_hz(log: Curves, rig: TwinRig) -> float:
    """Return the frequency of the strongest line across the rope near that of the rig; at the load, where none is, the rig's."""
    rig_hz = 1 / rig.small_swing_period_s
    frequency_hz, power = periodogram(log.time_s, log.measured_g / log.noise_g)
    near = (frequency_hz > rig_hz / NEAR_RIG) & (frequency_hz < rig_hz * NEAR_RIG)
    across = power[near, :2].sum(axis=1)
    is_seen = bool(across.size) and across.max() > len(log.time_s) ** 0.5
    return float(frequency_hz[near][np.argmax(across)]) if is_seen else rig_hz


def _share(residual: Array, motion: Array, noise_power: float) -> float:
    left, moved = (max(float((each**2).sum(axis=1).mean()) - noise_power, 0.0) for each in (residual, motion))
    return math.sqrt(left / moved) if moved else 0.0


def _swing_axes(across: Array) -> Array:
    """Return the axes along the swing, across it and along the rope, shape (3, 3), as columns in those of the housing."""
    _, vectors = np.linalg.eigh(across.T @ across)
    axes = np.eye(3)
    axes[:2, :2] = vectors[:, ::-1]
    return axes


def _is_wide(time_s: Array, motion: Array, period_s: float) -> NDArray[np.bool_]:
    """Return which samples are in blocks with a wider swing than the median of them."""
    block = ((time_s - time_s[0]) * BLOCKS_PER_PERIOD / period_s).astype(int)
    _, block = np.unique(block, return_inverse=True)
    power = np.bincount(block, (motion**2).sum(axis=1)) / np.bincount(block)
    wide: NDArray[np.bool_] = (power > np.median(power))[block]
    return wide


def _strongest_line(log: Curves, turned_g: Array, axis: int) -> Peak | None:
    """Return the line of the largest amplitude on one of the axes along the swing, across it and along the rope."""
    across_g = float(log.noise_g[:2].mean())
    noise_g = np.array([across_g, across_g, log.noise_g[2]])
    found = [peak for peak in find_peaks(log.time_s[log.used], turned_g / noise_g, noise_g) if peak.axis == "xyz"[axis]]
    return max(found, key=lambda peak: peak.amplitude_g, default=None)
