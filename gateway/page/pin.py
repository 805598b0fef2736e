"""The PIN that a person enters before the page acknowledges alarms: eight random digits in a file of the gateway."""

import os
import secrets
from contextlib import suppress
from pathlib import Path

from gateway.atomic_io import give_to_commanders

PIN_NAME = "page-pin"
PIN_DIGITS = 8
"""Basis: with `sign_in.MAX_SIGN_IN_PAUSE_S` half of the numbers need 95 years; a person types eight digits."""
MAX_PIN_FILE_BYTES = 256
"""Largest file with a PIN, bytes. Basis: a choice; the digits and a line's end, with room for spaces."""


def make_pin(path: Path) -> None:
    """Make the file with a random PIN where there is none, readable by those who may command. Raises `OSError`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o640)
        give_to_commanders(descriptor)
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(f"{secrets.randbelow(10**PIN_DIGITS):0{PIN_DIGITS}d}\n")
            file.flush()
            os.fsync(file.fileno())


def read_pin(path: Path | None) -> str | None:
    """Return the PIN of a file, read anew each time so that a changed one counts at once; None where there is none."""
    if path is None:
        return None
    try:
        with path.open(encoding="ascii") as file:
            pin = file.read(MAX_PIN_FILE_BYTES).strip()
    except (OSError, ValueError):
        return None
    return pin if pin.isdigit() and len(pin) >= PIN_DIGITS else None
