"""CPU and memory of the process, free space on the disk, and the offset of the host's wall clock from gateway time."""

import ctypes
import os
import shutil
import time
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from devices.host_clock import HostClock
from gateway.pipeline.outgoing_message import ClockState
from gateway.units import BYTES_PER_MB

DISK_RETRY_S = 5.0
"""Pause before a disk that has failed is tried again. Basis: a choice; a remounted disk is used soon, and one attempt costs
little."""
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
STEP_NS = 500_000_000
"""Change of the clock that is a step. Basis: a choice; ntpd slews differences below 128 ms, and a second is what a person
reads."""
TIME_ERROR = 5
"""Definition: the return value of adjtimex for a clock that is not synchronised (man 2 adjtimex)."""


def resident_mb() -> float | None:
    """Return the resident memory of this process, in MB; None where it cannot be determined, as with too many open files."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return None
    return pages * PAGE_BYTES / BYTES_PER_MB


def disk_free_mb(folder: Path) -> float | None:
    """Return the free space at a folder, in MB; None where it cannot be determined."""
    try:
        return shutil.disk_usage(folder).free / BYTES_PER_MB
    except OSError:
        return None


@dataclass(slots=True)
class CpuMeter:
    """Measures the CPU time of this process between two calls."""

    _cpu_s: float = field(default_factory=time.process_time)
    _at_s: float = field(default_factory=time.monotonic)

    def percent(self) -> float | None:
        """Return the CPU time since the last call, in percent of one core."""
        cpu_s, at_s = time.process_time(), time.monotonic()
        used_s, passed_s = cpu_s - self._cpu_s, at_s - self._at_s
        self._cpu_s, self._at_s = cpu_s, at_s
        return 100 * used_s / passed_s if passed_s > 0 else None


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
