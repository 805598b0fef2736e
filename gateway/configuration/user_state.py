"""Where this user's programs keep what they remember, by the XDG base directory specification, and the data folders of gateways.

By the data folders of gateways that this user has run, `plumbline remote` finds their command tokens.
"""

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from gateway.atomic_io import write_private
from gateway.file_input import read_bounded

DATA_FOLDERS = "data-folders"
MAX_FOLDERS = 32
"""Folders that are remembered, the newest. Basis: a choice; more than a host has, and a bound of the file."""


def user_state_folder(name: str, environment: Mapping[str, str]) -> Path | None:
    """Return the folder of this name, which need not exist; None without a home."""
    state, home = environment.get("XDG_STATE_HOME"), environment.get("HOME")
    if state:
        return Path(state) / "plumbline" / name
    return Path(home) / ".local" / "state" / "plumbline" / name if home else None


def remember_data_folder(data_dir: Path, environment: Mapping[str, str] = os.environ) -> None:
    """Remember a data folder; without a home, or where it cannot be written, nothing is remembered."""
    folder = user_state_folder(DATA_FOLDERS, environment)
    if folder is None:
        return
    with suppress(OSError):
        path = str(data_dir.resolve())
        write_private(folder / hashlib.sha256(path.encode()).hexdigest()[:16], f"{path}\n".encode(), 0o600)
        for old in sorted(folder.iterdir(), key=lambda entry: entry.stat().st_mtime)[:-MAX_FOLDERS]:
            old.unlink()


def known_data_folders(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Return the remembered folders that exist, the newest first."""
    folder = user_state_folder(DATA_FOLDERS, environment)
    if folder is None:
        return []
    found: list[tuple[float, Path]] = []
    with suppress(OSError):
        for entry in folder.iterdir():
            with suppress(OSError, UnicodeDecodeError):  # another gateway may be writing its own
                found.append((entry.stat().st_mtime, Path(read_bounded(entry).decode().strip())))
    return [path for _, path in sorted(found, reverse=True) if path.is_absolute() and path.is_dir()]
