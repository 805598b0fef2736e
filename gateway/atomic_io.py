"""Files that survive a kill and a power failure: written completely or not at all, and on the disk when the call returns."""

import contextlib
import errno
import grp
import os
import stat
from collections.abc import Iterator
from pathlib import Path

COMMAND_GROUP = "plumbline-command"
"""The group of those who may command an installed gateway; others read its recordings by the group of its files."""


def write_durably(path: Path, content: bytes) -> None:
    """Replace a file in one step, and make its folder where there is none. Raises `OSError`; the old file then stays."""
    make_folder(path.parent)
    with replace_file(path) as descriptor:
        _write_all(descriptor, content)


def write_private(path: Path, content: bytes, mode: int) -> None:
    """Write a file that has these access rights from its first byte on, as `write_durably` does. Raises `OSError`."""
    make_folder(path.parent)
    with replace_file(path, mode=0o600) as descriptor:
        os.fchmod(descriptor, mode)
        if mode & stat.S_IRGRP and not mode & stat.S_IROTH:
            give_to_commanders(descriptor)
        _write_all(descriptor, content)


def give_to_commanders(descriptor: int) -> None:
    """Give a secret that a group may read to those who may command, on a machine with that group; else to its owner alone."""
    try:
        group = grp.getgrnam(COMMAND_GROUP).gr_gid
    except KeyError:
        return
    try:
        os.fchown(descriptor, -1, group)
    except OSError:
        os.fchmod(descriptor, stat.S_IRUSR | stat.S_IWUSR)


@contextlib.contextmanager
def replace_file(path: Path, mode: int = 0o644) -> Iterator[int]:
    """Yield the descriptor of a new file that takes the place of `path` at the end of the block.

    It is synced, renamed, and the folder is synced. After an error in the block the old file stays and nothing else is left.
    Raises `OSError`.
    """
    _require_replaceable(path)
    partial = partial_of(path)
    try:
        # A link there would be another user's: root writes settings into a folder that the service may write.
        descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, mode)
        try:
            yield descriptor
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        partial.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise
    sync_folder(path.parent)


def _require_replaceable(path: Path) -> None:
    """Raise `OSError` where a device, a pipe or a folder has the name: a rename would put a file in its place."""
    with contextlib.suppress(FileNotFoundError):
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            number, text = (
                (errno.EISDIR, "is a folder") if stat.S_ISDIR(mode) else (errno.EINVAL, "is a device or a pipe")
            )
            raise OSError(number, text, str(path))


def partial_of(path: Path) -> Path:
    """Return the path of a file while it is incomplete; it is hidden from a listing."""
    return path.with_name(f".{path.name}.part")


def append_line(path: Path, line: bytes, *, durable: bool = True, max_bytes: int | None = None) -> None:
    """Append a line to a file, on a line of its own even if the last one is incomplete. Raises `OSError`.

    Not `durable`: the disk is not waited for, and a power failure may lose the line. A file of more than `max_bytes` becomes the
    previous file, `<name>.previous.jsonl`, of which there is one.
    """
    make_folder(path.parent)
    existed = path.exists()
    if existed and max_bytes is not None and path.stat().st_size > max_bytes:
        path.replace(path.with_suffix(".previous.jsonl"))
        existed = False
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW, 0o644)
    try:
        end = os.lseek(descriptor, 0, os.SEEK_END)
        incomplete = end > 0 and os.pread(descriptor, 1, end - 1) != b"\n"
        _write_all(descriptor, (b"\n" if incomplete else b"") + line + b"\n")
        if durable:
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
    if durable and not existed:
        sync_folder(path.parent)


def make_folder(folder: Path) -> None:
    """Make a folder and its parents where they are missing, and sync each. Raises `OSError`."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    sync_folder(folder.parent)


def _write_all(descriptor: int, content: bytes) -> None:
    while content:
        content = content[os.write(descriptor, content) :]


def sync_folder(folder: Path) -> None:
    """Write the names in a folder to the disk. Raises `OSError`."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
