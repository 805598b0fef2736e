"""The clock of this machine as gateway time."""

import time


class HostClock:
    """The gateway time of this machine."""

    def __init__(self) -> None:
        self.anchor_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the gateway time: the monotonic clock, anchored once to UTC."""
        return time.monotonic_ns() + self.anchor_ns

    def wall_offset_ns(self) -> int:
        """Return the UTC of the wall clock minus gateway time: the corrections by NTP since start."""
        return time.time_ns() - self.now_ns()

    def sleep_s(self, seconds: float) -> None:
        """Wait; return at once for zero or less."""
        if seconds > 0:
            time.sleep(seconds)
