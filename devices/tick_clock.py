"""Sample times of a node that states its own clock with each frame.

The node's clock counts microseconds at a constant rate that differs from the host's by up to per cents. The line between both is
found as for a count of samples, see `devices.sample_clock`: a microsecond is a sample of 1 MHz. The samples of a frame lie evenly
between the last one of the frame before and their own last one, whose time the node states; lost frames shift nothing.
"""

import numpy as np
from numpy.typing import NDArray

from devices.sample_clock import RADIO_MISFIT_DELAY_S, SampleClock

TICK_HZ = 1e6
"""Definition: microseconds."""
MAX_TICK_DIFFERENCE = 0.2
"""Relative deviation of the sample period from the nominal one, beyond which, and one period, the node has paused. Basis: a
choice; crystals differ by far less, and a pause by far more."""


class TickClock:
    """The gateway times of samples by the clock of their node."""

    def __init__(self, odr_hz: float) -> None:
        self._nominal_us = 1e6 / odr_hz
        self._clock = SampleClock(TICK_HZ, misfit_delay_s=RADIO_MISFIT_DELAY_S)
        self._period_ns = 1e9 / odr_hz
        self._last: tuple[int, int] | None = None  # (tick in us, gateway time in ns) of the newest sample

    @property
    def relearned(self) -> int:
        """How often the line was discarded because the node's clock did not continue."""
        return self._clock.relearned

    def restart(self) -> None:
        """Discard the line: the node's clock began anew. The rates remain."""
        self._clock.restart()
        self._last = None

    def continues(self, t_us: int, samples: int) -> bool:
        """Return whether the node's clock at the last of `samples` further samples agrees with the sample rate."""
        if self._last is None or t_us <= self._last[0]:
            return False
        expected_us = samples * self._nominal_us
        return abs(t_us - self._last[0] - expected_us) < MAX_TICK_DIFFERENCE * expected_us + self._nominal_us

    def stamp(self, n: int, t_us: int, read_ns: int, lost: int = 0) -> NDArray[np.int64]:
        """Return the gateway times in ns of the n samples of a frame, shape (n,), strictly increasing.

        `t_us` is the node's clock at the last one, `lost` the number of samples that are missing before the first.
        """
        passed_us = 1 if self._last is None else t_us - self._last[0]
        end_ns = int(self._clock.stamp(1, read_ns, lost=passed_us - 1)[0])
        if self._last is not None:
            self._period_ns = (end_ns - self._last[1]) / (n + lost)
        self._last = t_us, end_ns
        times_ns: NDArray[np.int64] = end_ns - np.rint(self._period_ns * np.arange(n - 1, -1, -1)).astype(np.int64)
        return times_ns
