"""What the believed rig makes of a recording: the excess of its reduced chi-square, with the initial motion fitted."""

from dataclasses import replace

import numpy as np

from tests.blind.engine import COARSE_STEP_S, simulate
from tests.blind.mechanics import Array, Start
from tests.blind.scene import Rig
from tests.blind.sensor import STANDARD_GRAVITY_M_S2, Recording, at_times

NUDGE_RAD = 1e-5
ROUNDS = 4


class BelievedMotion:
    """The swing of the believed rig from a start, and how it changes with tilts and rates."""

    def __init__(self, rig: Rig, start: Start, duration_s: float) -> None:
        self._rig, self._start, self._duration_s = rig, start, duration_s
        self._grid_s, self._there = self._swing(np.zeros(4))
        nudges = [self._swing(nudge)[1] for nudge in NUDGE_RAD * np.eye(4)]
        self._by = (np.stack(nudges, axis=-1) - self._there[..., None]) / NUDGE_RAD

    def excess(self, recording: Recording) -> float:
        """Least reduced chi-square over a few Gauss-Newton steps, less one."""
        by = np.stack([self._at(recording, self._by[..., i]) for i in range(4)], axis=-1).reshape(-1, 4)
        inverse, change, force_g = np.linalg.pinv(by), np.zeros(4), self._there
        best = np.inf
        for _ in range(ROUNDS):
            residual = (recording.force_g - self._at(recording, force_g)).ravel()
            best = min(best, float((residual**2).mean()) / self._rig.noise_g**2 - 1)
            change = change + inverse @ residual
            if np.abs(change).max() > 1:
                break
            force_g = self._swing(change)[1]
        return best

    def _swing(self, change: Array) -> tuple[Array, Array]:
        x, y, x_rate, y_rate = (float(value) for value in change)
        tilt, rate = self._start.tilt_rad, self._start.tilt_rate_rad_s
        start = replace(
            self._start, tilt_rad=(tilt[0] + x, tilt[1] + y), tilt_rate_rad_s=(rate[0] + x_rate, rate[1] + y_rate)
        )
        motion = simulate(self._rig.believed(), start, self._duration_s, COARSE_STEP_S)
        return motion.time_s, motion.force_m_s2 / STANDARD_GRAVITY_M_S2

    def _at(self, recording: Recording, values: Array) -> Array:
        return at_times(self._grid_s, values, recording.time_s)
