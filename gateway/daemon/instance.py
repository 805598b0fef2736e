"""One gateway per data folder."""

import fcntl
import os
from pathlib import Path

from gateway.errors import PlumblineError

LOCK_NAME = ".lock"


class InstanceError(PlumblineError):
    """The data folder cannot be used; the text states the reason in one line."""


def is_in_use(data_dir: Path) -> bool:
    """Return whether a gateway runs with a data folder, without changing anything; True where only the gateway may know."""
    try:
        with (data_dir / LOCK_NAME).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return True
    except OSError:
        return False
    return False


class InstanceLock:
    """The lock of a data folder for this process; the kernel releases it even after a kill."""

    def __init__(self, data_dir: Path) -> None:
        """Create the folder if necessary and lock it. Raises `InstanceError`."""
        path = data_dir / LOCK_NAME
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
        """Release the lock."""
        self._file.close()
