"""What a node states of its samples with each frame: their numbers, and its own clock.

Numbers tell what is new, what was lost, and when they began anew. A node's clock counts microseconds at a constant rate that
differs from the host's by up to per cents. The line between both is found as for a count of samples, see
`devices.sample_clock`: a microsecond is a sample of 1 MHz. The samples of a frame lie evenly between the last one of the
frame before and their own last one, whose time the node states; lost frames shift nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample_clock import RADIO_MISFIT_DELAY_S, SampleClock

REPEATED_NS = 500_000_000
"""Numbers that stay behind for longer are not late frames: the node has started again. Basis: a choice; a frame that is repeated
comes sooner, and a start takes longer."""
MAX_LATE_S = 10.0
"""A frame is at most this late. Basis: a choice; longer than a base station repeats a frame."""
JUMP_S, JUMP_SHARE = 2.0, 1.25
"""Numbers that run ahead of the time since the last frame by more: the node has started again, or changed its rate. Basis: a
choice; a radio is late by less, and the next rate differs by more."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The place of a frame among the samples."""

    lost: int
    """Number of samples that are missing before it; 0 where the numbers began anew."""
    repeated: int
    """Number of its first samples that are known already."""
    restarted: bool
    """The numbers began anew: what is missing can only be told by time."""


class SampleSequence:
    """Follows numbers that wrap around."""

    def __init__(self, bits: int, odr_hz: float) -> None:
        self._modulus = 1 << bits
        self._odr_hz = odr_hz
        self._next: int | None = None
        self._read_ns = 0
        self._repeated_from_ns: int | None = None

    def restart(self) -> None:
        """Forget the numbers: the node has started again."""
        self._next = None

    def place(self, first: int, count: int, read_ns: int) -> Placement:
        """Return the place of a frame of `count` samples, of which the first has this number."""
        ahead = self._ahead(first)
        restarted = ahead is None or self._is_jump(ahead, count, read_ns)
        if restarted or ahead is None:
            placement = Placement(lost=0, repeated=0, restarted=True)
        else:
            placement = Placement(lost=max(ahead, 0), repeated=min(max(-ahead, 0), count), restarted=False)
        if placement.repeated < count:
            self._next = (first + count) % self._modulus
            self._read_ns = read_ns
            self._repeated_from_ns = None
        return placement

    def _ahead(self, first: int) -> int | None:
        """Return by how much a number is ahead of the expected one; negative: behind."""
        if self._next is None:
            return None
        half = self._modulus // 2
        return (first - self._next + half) % self._modulus - half

    def _is_jump(self, ahead: int, count: int, read_ns: int) -> bool:
        if ahead >= 0:
            passed_s = (read_ns - self._read_ns) / 1e9
            return ahead > (passed_s * JUMP_SHARE + JUMP_S) * self._odr_hz
        if -ahead < count:
            return False
        if self._repeated_from_ns is None:
            self._repeated_from_ns = read_ns
        return -ahead > MAX_LATE_S * self._odr_hz or read_ns - self._repeated_from_ns > REPEATED_NS


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
