"""Reading of files that anybody may have written: regular files alone, of a bounded size and depth."""

import errno
import json
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from devices.regular_file import open_regular

T = TypeVar("T")
MAX_TOML_BYTES = 256_000
"""Largest configuration or rig that is read. Basis: a choice; a hundred times a long configuration, and a bound of the memory."""
DEEP_KEY = re.compile(r"(?<![\w\"'-])(?:[\w\"'-]++\s*+\.\s*+){32}")
"""The time of the parser grows with the square of the number of parts of a key. The search begins where a word does, and takes
back nothing: its own time grows with the length of the text alone.
"""
MAX_STATE_BYTES = 16_000_000
"""Largest state file or record that is read. Basis: a hundred times the largest that the gateway writes."""


def read_bounded(path: Path, max_bytes: int = MAX_STATE_BYTES) -> bytes:
    """Return the content of a regular file. Raises `OSError`, also for a pipe, a device and a file that is too large."""
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size > max_bytes:
            raise OSError(errno.EFBIG, f"has more than {max_bytes / 1e6:g} MB", str(path))
        return file.read(max_bytes)


def reason_of(error: Exception) -> str:
    """Return why a file cannot be read, without its name and the system's number."""
    return str((error.strerror if isinstance(error, OSError) else None) or error)


def read_owned(folder: Path, name: str, max_bytes: int = MAX_STATE_BYTES) -> bytes:
    """Return the end of a regular file below a folder, which belongs to the folder's owner and is reached through no link.

    For root, who reads in a folder that another user may write. Raises `OSError`.
    """
    *parents, last = Path(name).parts
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        owner = os.fstat(descriptor).st_uid
        for parent in parents:
            flags = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
            inner = os.open(parent, flags, dir_fd=descriptor)
            os.close(descriptor)
            descriptor = inner
        file = os.open(last, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=descriptor)
    finally:
        os.close(descriptor)
    with os.fdopen(file, "rb") as opened:
        state = os.fstat(file)
        if not stat.S_ISREG(state.st_mode) or state.st_uid != owner:
            raise OSError(errno.EPERM, "is not a file of the folder's owner", str(folder / name))
        opened.seek(max(0, state.st_size - max_bytes))
        return opened.read(max_bytes)


def parse_json(content: bytes | str) -> Any:
    """Return the value of a JSON text. Raises `ValueError`, also for one that is nested too deeply."""
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("is nested too deeply") from None


def decode_json(content: bytes | str, kind: type[T]) -> T:
    """Return the value of a JSON text, which has this type. Raises `ValueError`, also for one that is nested too deeply."""
    try:
        return msgspec.json.decode(content, type=kind)
    except RecursionError:
        raise ValueError("is nested too deeply") from None


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text. Raises `ValueError`, also for one that is nested too deeply."""
    if DEEP_KEY.search(text):
        raise ValueError("a key of more than 32 parts is nested too deeply")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("is nested too deeply") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file. Raises `OSError`, and `ValueError`, which says that the file is none, and why."""
    content = read_bounded(path, MAX_TOML_BYTES)
    try:
        return parse_toml(content.decode("utf-8-sig"))  # some editors begin a text with a byte order mark
    except UnicodeDecodeError:
        raise ValueError("is not UTF-8 text; a TOML file is needed") from None
    except ValueError as error:
        raise ValueError(f"is not TOML: {error}") from error
