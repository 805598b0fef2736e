"""What is known of a recording when the initial guesses of an effect are made."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EventWindow:
    """An interval outside of which the load moved freely."""

    from_s: float
    to_s: float
    remaining_chi2: float
    """Chi-square with a motion of its own before and after, samples inside counted as noise."""


@dataclass(frozen=True, slots=True)
class GuessContext:
    """A recording of n samples, the residual of the model so far, and the intervals in which something may have happened."""

    length_m: float
    """Nominal length of the rope."""
    gravity_m_s2: float
    time_s: Array
    """Since the first sample, shape (n,)."""
    force_g: Array
    """Measured specific force, shape (n, 3)."""
    noise_g: Array
    """Standard deviation of each axis, shape (3,)."""
    residual_g: Array
    """Measured - simulated by the model so far, shape (n, 3)."""
    windows: tuple[EventWindow, ...] = ()
    """From the changepoint scan, for increasing maximum lengths."""
    changepoints: EventWindow | None = None
    """Between the motion before an event and the motion after it; more reliable than the windows."""

    @property
    def duration_s(self) -> float:
        """From the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])
