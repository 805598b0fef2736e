"""Jobs for the disk, and who carries them out."""

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")
DiskJob = Callable[[Callable[[], bool]], None]
"""Reads or writes. Its argument says whether it is still wanted, which is asked before the last step. Raises `OSError`."""
PerformJob = Callable[[DiskJob], None]
"""Carries a job out, at once or within a bounded time. Raises `OSError`."""


def perform_now(job: DiskJob) -> None:
    """Carry a job out at once, however long it takes. Raises `OSError`."""
    job(lambda: True)


def read_with(perform: PerformJob, read: Callable[[], T]) -> T:
    """Return what is read by a job. Raises what reading raises, and `TimeoutError` where the disk takes too long."""
    found: list[T] = []
    perform(lambda _is_wanted: found.append(read()))
    return found[0]
