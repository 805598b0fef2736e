"""Gateway time: a clock that never steps.

Gateway time is the host's UTC in nanoseconds at start, continued by the monotonic clock. It does not step when the wall clock
does. Samples and messages are stamped and sorted by it; the `/clock` topic carries the offset of the wall clock. What a
configuration may choose needs the protocol alone, and no time.
"""

from typing import Protocol


class Clock(Protocol):
    """The clock that a device uses; tests provide their own."""

    def now_ns(self) -> int:
        """Return the gateway time."""
        ...

    def sleep_s(self, seconds: float) -> None:
        """Wait; return at once for zero or less."""
        ...
