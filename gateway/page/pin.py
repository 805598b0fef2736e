"""The PIN that a person enters before the page acknowledges alarms: random digits in a file of the gateway.

A PIN stands a number of wrong attempts in all, from whatever addresses, and is void then. Nobody waits after a wrong attempt, so
that whoever guesses keeps nobody out; the number of attempts alone bounds what guessing can achieve.
"""

import os
import secrets
from contextlib import suppress
from pathlib import Path

from gateway.atomic_io import give_to_commanders, write_private

PIN_NAME = "page-pin"
PIN_MODE = 0o640
PIN_DIGITS = 8
"""Digits of the first PIN. Basis: a person types eight digits."""
MORE_DIGITS = 4
"""Digits by which the successor of a void PIN is longer, so that it stands ten thousand times as many attempts. Basis: at the 300
attempts per second that one computer made, 8 digits are void after 3 s, 12 after 9 hours, 16 after 10 years."""
MAX_PIN_DIGITS = 16
"""Basis: a PIN that stands ten years of attempts needs no successor, and a person can still type it."""
CERTAIN_DIGITS = 5
"""A PIN of n digits stands 10^(n - 5) wrong attempts, so that guessing finds it with a probability of 1e-5. Basis: a choice; a
thousand attempts at eight digits, more than people mistype in the life of a PIN; NIST SP 800-63B permits 100 at six digits."""
MAX_PIN_FILE_BYTES = 256
"""Largest file with a PIN, bytes. Basis: a choice; the digits and a line's end, with room for spaces."""


def make_pin(path: Path) -> None:
    """Make the file with a random PIN where there is none, readable by those who may command. Raises `OSError`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, PIN_MODE)
        give_to_commanders(descriptor)
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(f"{_random_digits(PIN_DIGITS)}\n")
            file.flush()
            os.fsync(file.fileno())


def successor_of(pin: str) -> str:
    """Return the PIN that takes the place of a void one; it is longer."""
    return _random_digits(max(len(pin), min(len(pin) + MORE_DIGITS, MAX_PIN_DIGITS)))


def replace_pin(path: Path, pin: str) -> None:
    """Write a PIN in place of another, readable by those who may command. Raises `OSError`."""
    write_private(path, f"{pin}\n".encode("ascii"), PIN_MODE)


def most_wrong_attempts(pin: str) -> int:
    """Return the number of wrong attempts after which a PIN is void."""
    return int(10 ** (len(pin) - CERTAIN_DIGITS))


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


def _random_digits(count: int) -> str:
    return f"{secrets.randbelow(10**count):0{count}d}"
