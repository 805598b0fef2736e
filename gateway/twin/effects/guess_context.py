"""What the initial guesses of an effect can be computed from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EventWindow:
    """An interval outside which the load swings freely."""

    from_s: float
    to_s: float
    remaining_chi2: float
    """Chi-square with separate motions before and after the interval; samples inside it count as noise."""


@dataclass(frozen=True, slots=True)
class GuessContext:
    """A recording of n samples, the residual of the model so far, and the intervals in which an event may have acted."""

    length_m: float
    """Nominal length of the rope."""
    gravity_m_s2: float
    time_s: Array
    """Since the first sample, shape (n,)."""
    force_g: Array
    """Measured specific force, shape (n, 3)."""
    noise_g: Array
    """Standard deviation of the noise of each axis, shape (3,)."""
    residual_g: Array
    """Measured minus simulated by the model so far, shape (n, 3)."""
    windows: tuple[EventWindow, ...] = ()
    """Results of the changepoint scan, in order of increasing maximum length."""
    changepoints: EventWindow | None = None
    """The interval between the motion before an event and the motion after it; more reliable than the windows."""

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])
