"""Reading of files that anybody may have written: regular files alone, of a bounded size and depth."""

import errno
import json
import os
import stat
from pathlib import Path
from typing import Any

MAX_STATE_BYTES = 16_000_000
"""Largest state file, configuration or record that is read: a hundred times the largest that the gateway writes."""


def read_bounded(path: Path, max_bytes: int = MAX_STATE_BYTES) -> bytes:
    """Return the content of a regular file. Raises `OSError`, also for a pipe, a device and a file that is too large."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "is not a regular file", str(path))
        if status.st_size > max_bytes:
            raise OSError(errno.EFBIG, f"has more than {max_bytes / 1e6:g} MB", str(path))
        return file.read(max_bytes)


def parse_json(content: bytes | str) -> Any:
    """Return the value of a JSON text. Raises `ValueError`, also for one that is nested too deeply."""
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("is nested too deeply") from None
