"""Stillness: whether the sensor was at rest in a window, by its own noise and by a limit in g."""

from collections import deque

import numpy as np

from gateway.calibration.poses.windows import Window

MAX_KEPT_WINDOWS = 400
"""Number of windows whose scatter is kept: 100 s."""
QUIET_QUANTILE = 0.2
"""Quantile of the windows' scatter that is taken for the sensor's noise: one window in five is at rest in every session."""
STILL_RATIO = 3.0
"""Largest scatter of a still window over the sensor's noise."""
STILL_LIMIT_G = 0.025
"""Largest scatter of a still window for any sensor, g: a hand or a running machine moves it by more."""


class StillnessGate:
    """Decides whether a window is still, by the noise that the sensor has shown so far."""

    def __init__(self, units_per_g: float) -> None:
        self._units_per_g = units_per_g
        self._window_sigmas_g: deque[float] = deque(maxlen=MAX_KEPT_WINDOWS)

    @property
    def noise_g(self) -> float:
        """Standard deviation of one reading, g, from the quiet windows so far; 0 before the first window."""
        return float(np.quantile(self._window_sigmas_g, QUIET_QUANTILE)) if self._window_sigmas_g else 0.0

    def is_still(self, window: Window) -> bool:
        """Include the window in the estimate of the noise, and return whether it is still."""
        sigma_g = float(np.max(window.sigma)) / self._units_per_g
        step_g = window.step / self._units_per_g
        self._window_sigmas_g.append(sigma_g)
        return sigma_g <= min(max(STILL_RATIO * self.noise_g, step_g), STILL_LIMIT_G)
