"""The offset of the wall clock from gateway time, and whether the kernel's clock is synchronised."""

import ctypes
from functools import cache

from devices.host_clock import HostClock
from gateway.pipeline.outgoing_message import ClockState

STEP_NS = 500_000_000
"""Change of the clock that is a step. Basis: a choice; ntpd slews differences below 128 ms, and a second is what a person
reads."""
TIME_ERROR = 5
"""Definition: the return value of adjtimex for a clock that is not synchronised (man 2 adjtimex)."""


class WallClockMonitor:
    """Compares the wall clock with gateway time; call `poll` about once a second."""

    def __init__(self, clock: HostClock) -> None:
        self.clock = clock
        self.state = ClockState("free_running", 0)
        self.steps = 0
        """How often the wall clock has stepped."""

    def poll(self) -> ClockState:
        """Return the present state, and count a step of the wall clock."""
        offset_ns = self.clock.wall_offset_ns()
        if abs(offset_ns - self.state.wall_offset_ns) > STEP_NS:
            self.steps += 1
        self.state = ClockState("synchronised" if _is_kernel_synchronised() else "free_running", offset_ns)
        return self.state


def _is_kernel_synchronised() -> bool:
    """Return whether a time service disciplines the clock, by adjtimex in read-only mode."""
    request = ctypes.create_string_buffer(512)  # struct timex, all zero: modes = 0 reads
    state: int = _library().adjtimex(request)
    return 0 <= state < TIME_ERROR


@cache
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(None)
