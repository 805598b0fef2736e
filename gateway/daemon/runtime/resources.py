"""CPU and memory of the process, and free space on the disk."""

import os
import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path

from gateway.units import BYTES_PER_MB

DISK_RETRY_S = 5.0
"""Pause before a disk that has failed is tried again. Basis: a choice; a remounted disk is used soon, and one attempt costs
little."""
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


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
