"""Signing in on the page: the PIN, who has entered it, and what the gateway is told of it. The time is an argument.

The PIN that a person enters before the page acknowledges alarms is random digits in a file of the gateway. It stands a number of
wrong attempts in all, from whatever addresses, and is void then. Nobody waits after a wrong attempt, so that whoever guesses
keeps nobody out; the number of attempts alone bounds what guessing can achieve.
"""

import hmac
import os
import secrets
from collections import OrderedDict
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

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
EXPIRY_S = 600.0
"""Time after its last use at which a session ends. Basis: a choice; it lasts over the alarms of a difficult lift, and not into
the next person's work."""
MAX_SESSIONS = 64
"""Persons who are signed in. Basis: a choice; more than a crane has, and a bound of the memory."""
PinState = Literal["good", "void", "replaced"]


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


@dataclass(frozen=True, slots=True)
class SignedInPerson:
    """A person who has entered the PIN."""

    name: str
    until_s: float


class SignIn:
    """The sessions of one page; they are bounded, the oldest is forgotten first.

    Sessions outlive a PIN that became void by wrong attempts, and end with one that a person replaced.
    """

    def __init__(self) -> None:
        self._sessions: OrderedDict[str, SignedInPerson] = OrderedDict()
        self._pin: str | None = None
        self._is_known = False
        self.wrong_attempts = 0
        """At the present PIN."""
        self.successor: str | None = None
        """The PIN that takes the place of the present one, which is void; None while it is good."""

    def use(self, pin: str | None) -> None:
        """Take the PIN that the file has now; None where it has none."""
        self._is_known = pin is not None
        if pin is None or pin == self._pin:
            return
        if pin != self.successor:
            self._sessions.clear()
        self._pin, self.wrong_attempts, self.successor = pin, 0, None

    @property
    def is_possible(self) -> bool:
        """Whether there is a PIN, and it is not void."""
        return self._is_known and self.successor is None

    def sign_in(self, name: str, entered: str, now_s: float) -> str | None:
        """Begin a session and return its token; None where the PIN is wrong or void."""
        if self._pin is None or not self.is_possible:
            return None
        if not hmac.compare_digest(entered.encode(), self._pin.encode()):
            self.wrong_attempts += 1
            if self.wrong_attempts >= most_wrong_attempts(self._pin):
                self.successor = successor_of(self._pin)
            return None
        token = secrets.token_urlsafe(32)
        self._sessions[token] = SignedInPerson(name, now_s + EXPIRY_S)
        while len(self._sessions) > MAX_SESSIONS:
            self._sessions.popitem(last=False)
        return token

    def session(self, token: str | None, now_s: float) -> SignedInPerson | None:
        """Return the session of a token; None where it has expired or there is no PIN."""
        found = None if token is None or not self._is_known else self._sessions.get(token)
        return None if found is None or found.until_s <= now_s else found

    def note_use(self, token: str | None, now_s: float) -> None:
        """Let a session that was used last anew; to ask who is signed in is no use."""
        if token is not None and (found := self.session(token, now_s)) is not None:
            self._sessions[token] = SignedInPerson(found.name, now_s + EXPIRY_S)

    def sign_out(self, token: str | None) -> None:
        """End a session."""
        if token is not None:
            self._sessions.pop(token, None)


class SignInReport(BaseModel):
    """One report."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    wrong: Annotated[int, Field(ge=0)]
    """Wrong PINs since the report before."""
    address: Annotated[str, Field(max_length=64)]
    """Where the last one was entered."""
    pin: PinState | None
    """What became of the PIN: somebody has signed in with it; it is void; a new one is in its file. None: nothing new."""
