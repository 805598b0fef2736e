"""Time: one clock that never steps.

*Gateway time* is UTC in nanoseconds as the host believed it at start, carried on by the monotonic clock: it never jumps,
whatever the wall clock does. Everything is stamped and sorted by it; the `/clock` topic carries its offset from the wall.
"""

import time
from typing import Protocol


class Clock(Protocol):
    """What a device needs of time; a test hands in its own."""

    def now_ns(self) -> int:
        """Gateway time."""
        ...

    def sleep_s(self, seconds: float) -> None:
        """Wait; returns at once for zero or less."""
        ...


class HostClock:
    """Gateway time of this machine."""

    def __init__(self) -> None:
        self.anchor_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Gateway time: the monotonic clock, anchored once to UTC."""
        return time.monotonic_ns() + self.anchor_ns

    def wall_offset_ns(self) -> int:
        """UTC by the wall clock now, minus gateway time: what NTP has corrected since start."""
        return time.time_ns() - self.now_ns()

    def sleep_s(self, seconds: float) -> None:
        """Wait; returns at once for zero or less."""
        if seconds > 0:
            time.sleep(seconds)
