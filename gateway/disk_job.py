"""Jobs for the disk, and who carries them out."""

from collections.abc import Callable
from typing import Protocol, TypeVar

T = TypeVar("T")
DiskJob = Callable[[Callable[[], bool]], T]
"""Reads or writes. Its argument says whether it is still wanted, which is asked before the last step. Raises `OSError`."""


class PerformJob(Protocol):
    """Carries a job out, at once or within a bounded time."""

    def __call__(self, job: DiskJob[T], /) -> T:
        """Return what the job returns. Raises what it raises, and `TimeoutError` where the disk takes too long."""


def perform_now(job: DiskJob[T], /) -> T:
    """Carry a job out at once, however long it takes. Raises `OSError`."""
    return job(lambda: True)
