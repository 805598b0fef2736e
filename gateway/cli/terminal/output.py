"""Output of commands: files that are written completely or not at all, and JSON on the standard output."""

import json
import os
from pathlib import Path

from gateway.atomic_io import replace_file
from gateway.errors import InputError
from gateway.text import printable

STANDARD_OUTPUT = Path("-")
"""The value of `--json` for the standard output."""


def show(text: str, content: object, json_path: Path | None) -> None:
    """Print a result as text, and write it as JSON too where a path is given; `-`: print it as JSON in place of the text.

    Raises `InputError` where the file cannot be written.
    """
    if json_path == STANDARD_OUTPUT:
        print_json(content)
        return
    if json_path is not None:
        write_json(json_path, content)
    print("\n".join(map(printable, text.split("\n"))))  # a file may contain what steers a terminal


def write_json(path: Path, content: object) -> None:
    """Write a JSON file in one step. Raises `InputError` where it cannot be written."""
    write_text(path, _encode(content))


def print_json(content: object) -> None:
    """Print JSON to the standard output."""
    print(_encode(content), end="")


def _encode(content: object) -> str:
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write a text file in one step. Raises `InputError` where it cannot be written."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file in one step. Raises `InputError` where it cannot be written."""
    try:
        with replace_file(path) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
            file.write(content)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from error
