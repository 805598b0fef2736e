"""The motion of the rope over a whole recording: at each time from the readings before and after it.

The live tracker runs over the recording; from its end, each state is corrected by what the later ones found (Rauch et al.
1965), for the mean and covariance over all hypotheses, whose joint moments over a step are exact.
"""

import cmath
import math
from typing import Any

import numpy as np

from gateway.motion.description import motion_state
from gateway.motion.history import MotionHistory
from gateway.motion.motion_tracker import MotionTracker
from gateway.motion.peaks import ellipse
from gateway.motion.state_estimate import Angle
from gateway.motion.state_vector import GRAVITY, GUST, HOIST_SPEED, LN_LENGTH, PIVOT, RATE, SIDE_FORCE
from gateway.motion.step_record import Moments
from gateway.numerics.array import Array
from gateway.swing.model.sensor_lowpass import delay_s
from gateway.swing.rig import MountedHousing

BLOCK_STEPS, LOOKAHEAD_STEPS = 1500, 400
"""Steps that are smoothed at once, and later ones from which the smoothing begins. Basis: bounds the memory; what comes more than
some periods later tells nothing about the motion."""
SAMPLES = 4096
"""Samples that the tracker takes at once."""


class Smoother:
    """Smooths the steps of trackers that keep them, block by block while they go on."""

    def __init__(self, gravity_m_s2: float) -> None:
        self._gravity_m_s2 = gravity_m_s2
        self._parts: list[MotionHistory] = []

    def take(self, tracker: MotionTracker) -> None:
        """Smooth the oldest steps of a tracker, where there are enough later ones."""
        history = tracker.leader.history
        if history is None or len(history.steps) < BLOCK_STEPS + LOOKAHEAD_STEPS:
            return
        for candidate in tracker.candidates:
            if candidate.history is not None and candidate.history is not history:
                del candidate.history.steps[:BLOCK_STEPS]
        self._add(history.smooth(BLOCK_STEPS))

    def close(self, tracker: MotionTracker) -> None:
        """Smooth all steps of a tracker that takes no more samples."""
        tracker.finish()
        for history in (*tracker.ended, tracker.leader.history):
            if history is not None:
                self._add(history.smooth())

    def history(self) -> MotionHistory | None:
        """Return the motion at all steps so far; None: there are none."""
        return MotionHistory.join(self._parts) if self._parts else None

    def _add(self, states: list[tuple[float, Moments]]) -> None:
        if states:
            self._parts.append(_history(states, self._gravity_m_s2))


def smooth_motion(
    time_s: Array, force_g: Array, rig: MountedHousing, mount_u_rad: float, noise_g: float | None = None
) -> MotionHistory:
    """Return the motion over a recording.

    `time_s`, shape (n,), rising; `force_g`, shape (n, 3): specific force in the housing frame. `mount_u_rad`: standard
    uncertainty of the housing's z axis against the rope; `noise_g`: stated, 1 sigma per sample. Raises ValueError where there are
    no samples.
    """
    tracker = MotionTracker(rig, mount_u_rad=mount_u_rad, noise_g=noise_g, keeps_steps=True)
    smoother, time_s = Smoother(rig.gravity_m_s2), time_s - delay_s(rig.bandwidth_hz)
    for begin in range(0, len(time_s), SAMPLES):
        part = slice(begin, begin + SAMPLES)
        tracker.update(time_s[part], force_g[part])
        smoother.take(tracker)
    smoother.close(tracker)
    history = smoother.history()
    if history is None:
        raise ValueError("a recording without samples has no motion")
    return history


def _history(states: list[tuple[float, Moments]], gravity_m_s2: float) -> MotionHistory:
    """Return the motion at the times of states."""
    rows = [_row(moments, gravity_m_s2) for _, moments in states]
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
