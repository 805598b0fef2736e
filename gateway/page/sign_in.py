"""Who may acknowledge: sessions of people who entered the PIN, and how often it was guessed at. Pure; the time is an argument."""

import hmac
import secrets
from collections import OrderedDict
from dataclasses import dataclass

from gateway.page.pin import most_wrong_attempts, successor_of

EXPIRY_S = 8 * 3600.0
"""Length of a session. Basis: a shift."""
MAX_SESSIONS = 64
"""Persons who are signed in. Basis: a choice; more than a crane has, and a bound of the memory."""


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

    def sign_out(self, token: str | None) -> None:
        """End a session."""
        if token is not None:
            self._sessions.pop(token, None)
