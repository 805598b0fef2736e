"""How gateway time stands to UTC, and whether the kernel believes its own clock."""

import ctypes

from devices.clock import HostClock
from gateway.pipeline.clock_state import ClockState

STEP_NS = 500_000_000
TIME_ERROR = 5
"""adjtimex: the clock is not synchronised (man 2 adjtimex)."""


class WallClockWatch:
    """Compares the wall clock to gateway time; call about once a second."""

    def __init__(self, clock: HostClock) -> None:
        self.clock = clock
        self.state = ClockState("free_running", 0)
        self.steps = 0

    def poll(self) -> ClockState:
        """The state now; counts jumps of the wall clock."""
        offset_ns = self.clock.wall_offset_ns()
        if abs(offset_ns - self.state.wall_offset_ns) > STEP_NS:
            self.steps += 1
        self.state = ClockState("synchronised" if _kernel_synchronised() else "free_running", offset_ns)
        return self.state


def _kernel_synchronised() -> bool:
    """Whether a time service disciplines the clock: adjtimex in read-only mode."""
    request = ctypes.create_string_buffer(512)  # struct timex, all zero: modes = 0 reads
    state: int = ctypes.CDLL(None).adjtimex(request)
    return 0 <= state < TIME_ERROR
