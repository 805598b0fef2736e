"""The thread that writes state files, so that the thread that wants them written never waits for the disk."""

import logging
from dataclasses import dataclass
from pathlib import Path

from gateway.atomic_io import write_durably
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.faults import FaultRegister
from gateway.daemon.worker import Worker

log = logging.getLogger("plumbline.daemon")
INBOX = 64
PART = "state_files"


@dataclass(frozen=True, slots=True)
class FileContent:
    """A file and its new content."""

    path: Path
    content: bytes


class FileWriter(Worker[FileContent]):
    """Replaces files one after the other."""

    def __init__(self, faults: FaultRegister) -> None:
        super().__init__("state-files", BoundedQueue(INBOX))
        self._faults = faults

    def handle(self, item: FileContent) -> None:
        """Replace a file; the old one stays where that fails."""
        try:
            write_durably(item.path, item.content)
        except OSError as error:
            self._faults.set(PART, f"{item.path}: cannot be saved ({error.strerror or error})")
        else:
            self._faults.clear(PART)

    def close(self) -> None:
        """Nothing is open between two files."""
