"""Whether the sensor was still in a window: against its own noise, and in g."""

from collections import deque

import numpy as np

from gateway.calibration.poses.windows import Window

KEPT_WINDOWS = 400
QUIET_QUANTILE = 0.2
STILL_RATIO = 3.0
"""A still window scatters at most so many times as much as the quiet ones before it."""
STILL_LIMIT_G = 0.025
"""However noisy the sensor: more is a moving hand or a running machine."""


class StillnessGate:
    """Whether a window is still, by the noise that the sensor itself has shown."""

    def __init__(self, units_per_g: float) -> None:
        self._units_per_g = units_per_g
        self._quiet: deque[float] = deque(maxlen=KEPT_WINDOWS)

    @property
    def noise_g(self) -> float:
        """Of a reading, from the quiet windows so far; 0 before any."""
        return float(np.quantile(self._quiet, QUIET_QUANTILE)) if self._quiet else 0.0

    def is_still(self, window: Window) -> bool:
        """Take the window into account and judge it."""
        scatter_g = float(np.max(window.scatter)) / self._units_per_g
        step_g = window.step / self._units_per_g
        self._quiet.append(scatter_g)
        return scatter_g <= min(max(STILL_RATIO * self.noise_g, step_g), STILL_LIMIT_G)
