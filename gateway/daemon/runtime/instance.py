"""One gateway per data folder."""

import fcntl
import os
import stat
import time
from contextlib import suppress
from pathlib import Path

from gateway.errors import PlumblineError

LOCK_NAME = ".lock"
LOCK_MODE = 0o600
"""Whoever can open the file can lock it, and so keep a gateway from starting. Definition: access rights."""


class InstanceError(PlumblineError):
    """Another gateway uses the data folder; the text states which, in one line."""


class FolderError(PlumblineError):
    """The data folder cannot be used at present; the text states the reason in one line."""


def is_in_use(data_dir: Path) -> bool:
    """Return whether a gateway runs with a data folder, without changing anything; True where only the gateway may know."""
    try:
        descriptor = os.open(data_dir / LOCK_NAME, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except PermissionError:
        return True
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


class InstanceLock:
    """The lock of a data folder for this process; the kernel releases it even after a kill."""

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / LOCK_NAME
        self._descriptor: int | None = None

    def acquire(self) -> None:
        """Lock the folder, which is made where there is none; may be called again.

        Raises `InstanceError` where another gateway holds the lock, and `FolderError` where it cannot be known.
        """
        if self._descriptor is not None:
            return
        folder = self._path.parent
        try:
            descriptor = self._open()
        except OSError as error:
            raise FolderError(
                f"{folder}: cannot be written ({error.strerror}); choose another gateway.data_dir or mend its rights"
            ) from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            holder = _read_holder(descriptor)
            os.close(descriptor)
            if not isinstance(error, BlockingIOError):
                raise FolderError(f"{folder}: cannot be locked ({error.strerror})") from error
            raise InstanceError(
                f"{folder}: is in use by another gateway (process {holder or 'unknown'}); "
                "stop it, or choose another gateway.data_dir"
            ) from error
        self._descriptor = descriptor
        with suppress(OSError):  # on a full or read-only disk the lock holds without the number
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)

    def release(self) -> None:
        """Release the lock."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _open(self) -> int:
        """Return a descriptor of the file; for reading only where the file system allows no more. Raises `OSError`."""
        flags = os.O_CLOEXEC | os.O_NONBLOCK
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):
                if not stat.S_ISREG(self._path.lstat().st_mode):  # a link, a pipe or a folder, which no gateway makes
                    self._path.replace(self._path.with_name(f"{LOCK_NAME}.foreign-{time.time_ns()}"))
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | flags | os.O_NOFOLLOW, LOCK_MODE)
        except OSError:
            with suppress(OSError):
                return os.open(self._path, os.O_RDONLY | flags)
            raise
        with suppress(OSError):  # one that a former version made
            os.fchmod(descriptor, LOCK_MODE)
        return descriptor


def _read_holder(descriptor: int) -> str:
    with suppress(OSError):
        return os.pread(descriptor, 20, 0).decode(errors="replace").strip()
    return ""
