"""Files that commands write: whole or not at all."""

import contextlib
import json
import os
from pathlib import Path

from gateway.errors import InputError


def write_json(path: Path, content: object) -> None:
    """Write JSON in one step, so that a reader never sees half of it. Raises `InputError` where it cannot be written."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file in one step. Raises `InputError` where it cannot be written."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from error
