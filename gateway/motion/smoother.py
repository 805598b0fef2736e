"""The motion of the rope over a whole recording: at each time from the readings before and after it.

The live tracker runs over the recording; from its end, each state is corrected by what the later ones found (Rauch et al.
1965), for the mean and covariance over all hypotheses, whose joint moments over a step are exact.
"""

import cmath
import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.motion.description import motion_state
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.history import MotionHistory
from gateway.motion.motion_tracker import MotionTracker
from gateway.motion.peaks import ellipse
from gateway.motion.state_estimate import Angle
from gateway.motion.state_vector import GRAVITY, GUST, HOIST_SPEED, LN_LENGTH, PIVOT, RATE, SIDE_FORCE
from gateway.motion.step_record import Moments
from gateway.numerics.array import Array
from gateway.swing.model.sensor_lowpass import delay_s
from gateway.swing.rig import MountedHousing

LONGEST_GAP_PERIODS = 8.0
"""A longer gap divides the recording: beyond it the phase of the swing is not known."""
LONGEST_GAP_S = 120.0
"""Longest gap in any case."""
BLOCK_STEPS, LOOKAHEAD_STEPS = 1500, 400
"""Steps that are smoothed at once, and later ones from which the smoothing begins. Basis: bounds the memory; what comes more than
some periods later tells nothing about the motion."""
SAMPLES = 4096
"""Samples that the tracker takes at once."""


def smooth_motion(
    time_s: Array,
    force_g: Array,
    rig: MountedHousing,
    mount_u_rad: float,
    noise_g: float | None = None,
    is_clipped: NDArray[np.bool_] | None = None,
    rate_rad_s: Array | None = None,
    gyro: GyroPrior | None = None,
) -> MotionHistory:
    """Return the motion over a recording.

    `time_s`, shape (n,), rising; `force_g`, shape (n, 3): specific force in the housing frame. Rows with NaN are left out.
    `mount_u_rad`: standard uncertainty of the housing's z axis against the rope; `noise_g`: stated, 1 sigma per sample.
    `rate_rad_s`, shape (n, 3): angular rates in the housing frame, NaN where a sample has none; `gyro`: what is known of the
    gyroscope; None without one.
    """
    is_usable = np.isfinite(force_g).all(axis=1)
    clipped = np.zeros(len(time_s), dtype=bool) if is_clipped is None else is_clipped
    time_s, force_g, clipped = time_s[is_usable] - delay_s(rig.bandwidth_hz), force_g[is_usable], clipped[is_usable]
    rates = None if rate_rad_s is None or gyro is None else rate_rad_s[is_usable]
    longest_gap_s = min(LONGEST_GAP_PERIODS * rig.small_swing_period_s, LONGEST_GAP_S)
    bounds = [0, *(np.flatnonzero(np.diff(time_s) > longest_gap_s) + 1).tolist(), len(time_s)]
    histories: list[MotionHistory] = []
    for start, stop in pairwise(bounds):
        tracker = MotionTracker(rig, mount_u_rad=mount_u_rad, noise_g=noise_g, gyro=gyro, keeps_steps=True)
        for begin in range(start, stop, SAMPLES):
            part = slice(begin, min(begin + SAMPLES, stop))
            tracker.update(time_s[part], force_g[part], clipped[part], None if rates is None else rates[part])
            histories += _smooth_oldest(tracker, rig)
        tracker.finish()
        histories += _smooth_rest(tracker, rig)
    return MotionHistory.join(histories)


def _smooth_oldest(tracker: MotionTracker, rig: MountedHousing) -> list[MotionHistory]:
    """Return the motion at the oldest steps, where there are enough later ones."""
    history = tracker.leader.history
    if history is None or len(history.steps) < BLOCK_STEPS + LOOKAHEAD_STEPS:
        return []
    for candidate in tracker.candidates:
        if candidate.history is not None and candidate.history is not history:
            del candidate.history.steps[:BLOCK_STEPS]
    return [_history(history.smooth(BLOCK_STEPS), rig)]


def _smooth_rest(tracker: MotionTracker, rig: MountedHousing) -> list[MotionHistory]:
    histories = [*tracker.ended, tracker.leader.history]
    parts = [history.smooth() for history in histories if history is not None]
    return [_history(part, rig) for part in parts if part]


def _history(states: list[tuple[float, Moments]], rig: MountedHousing) -> MotionHistory:
    """Return the motion at the times of states."""
    rows = [_row(moments, rig.gravity_m_s2) for _, moments in states]
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "state"}
    return MotionHistory(
        time_s=np.array([time_s for time_s, _ in states]),
        probabilities=np.array([moments.weight for _, moments in states]),
        state=tuple(row["state"] for row in rows),
        **columns,
    )


def _row(moments: Moments, gravity_m_s2: float) -> dict[str, Any]:
    mean, covariance = moments.mean, moments.covariance
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    u, w, side = (complex(*mean[pair].tolist()) for pair in (GRAVITY, RATE, SIDE_FORCE))
    pushing = side + complex(*mean[GUST].tolist())
    angle, length_m = Angle.of(u, covariance[GRAVITY, GRAVITY]), math.exp(mean[LN_LENGTH])
    major, _, _ = ellipse(u + pushing, -w / math.sqrt(gravity_m_s2 / length_m))
    total = float(np.hypot(*sigma[GRAVITY]))
    named = motion_state(moments.weight, major, total, float(mean[HOIST_SPEED]), float(sigma[HOIST_SPEED]))
    known = angle.is_known
    return {
        "angle_rad": angle.angle_rad if known else math.nan,
        "u_rad": angle.u_rad if known else math.nan,
        "azimuth_rad": cmath.phase(-u) if known else math.nan,
        "rate_rad_s": -(angle.direction * w.conjugate()).real if known else math.nan,
        "pivot_acceleration_m_s2": mean[PIVOT] * gravity_m_s2,
        "pivot_acceleration_u_m_s2": float(np.hypot(*sigma[PIVOT])) / math.sqrt(2) * gravity_m_s2,
        "hoist_m_s": float(mean[HOIST_SPEED]),
        "hoist_u_m_s": float(sigma[HOIST_SPEED]),
        "length_m": length_m,
        "length_u_m": length_m * float(sigma[LN_LENGTH]),
        "state": named if known else "unknown",
    }
