"""Jobs for the disk, and who carries them out."""

from collections.abc import Callable

DiskJob = Callable[[Callable[[], bool]], None]
"""Writes something. Its argument says whether it is still wanted, which is asked before the last step. Raises `OSError`."""
PerformJob = Callable[[DiskJob], None]
"""Carries a job out, at once or within a bounded time. Raises `OSError`."""


def perform_now(job: DiskJob) -> None:
    """Carry a job out at once, however long it takes. Raises `OSError`."""
    job(lambda: True)
