"""One gateway per data folder."""

import fcntl
import os
from pathlib import Path

from gateway.errors import PlumblineError


class InstanceError(PlumblineError):
    """The data folder cannot be used; the text says why in one line."""


class InstanceLock:
    """Holds a data folder for this process; released by the kernel even after a kill."""

    def __init__(self, data_dir: Path) -> None:
        """Create the folder where needed and take it. Raises `InstanceError`."""
        path = data_dir / ".lock"
        try:
            data_dir.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+", encoding="ascii")
        except OSError as error:
            raise InstanceError(
                f"{data_dir}: cannot be written ({error.strerror}); choose another gateway.data_dir or mend its rights"
            ) from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            self._file.seek(0)
            holder = self._file.read().strip()
            self._file.close()
            raise InstanceError(
                f"{data_dir}: is in use by another gateway (process {holder or 'unknown'}); "
                "stop it, or choose another gateway.data_dir"
            ) from error
        self._file.truncate(0)
        self._file.write(f"{os.getpid()}\n")
        self._file.flush()

    def release(self) -> None:
        """Let the folder go."""
        self._file.close()
