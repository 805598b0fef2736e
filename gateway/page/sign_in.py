"""Who may acknowledge: sessions of people who entered the PIN, and the pause after a wrong one. Pure; the time is an argument."""

import hmac
import ipaddress
import secrets
from collections import OrderedDict
from dataclasses import dataclass

EXPIRY_S = 8 * 3600.0
"""Length of a session. Basis: a shift."""
MAX_SESSIONS = 64
"""Persons who are signed in. Basis: a choice; more than a crane has, and a bound of the memory."""
MIN_SIGN_IN_PAUSE_S = 1.0
"""Pause after a wrong PIN, doubled with each. Basis: a choice; a mistyped digit costs a second."""
MAX_SIGN_IN_PAUSE_S = 60.0
"""With one attempt a minute an address needs 95 years for half of the eight-digit numbers. Basis: with one attempt a minute an
address needs 95 years for half of the eight-digit numbers."""
MAX_ADDRESSES = 1024
"""Addresses whose failures are remembered. Basis: a choice; more than a site has, and a bound of the memory."""


@dataclass(frozen=True, slots=True)
class SignedInPerson:
    """A person who has entered the PIN."""

    name: str
    pin: str
    """The PIN that was valid then; another one ends the session."""
    until_s: float


@dataclass(frozen=True, slots=True)
class _Failures:
    count: int
    at_s: float

    @property
    def pause_s(self) -> float:
        return min(MIN_SIGN_IN_PAUSE_S * 2.0 ** min(self.count - 1, 16), MAX_SIGN_IN_PAUSE_S)


class SignIn:
    """The sessions of one page, and the wrong attempts by address; both are bounded, the oldest is forgotten first."""

    def __init__(self) -> None:
        self._sessions: OrderedDict[str, SignedInPerson] = OrderedDict()
        self._failures: OrderedDict[str, _Failures] = OrderedDict()

    def pause_s(self, address: str, now_s: float) -> float:
        """Return for how long an address must wait before its next attempt."""
        failures = self._failures.get(_network(address))
        return 0.0 if failures is None else max(failures.at_s + failures.pause_s - now_s, 0.0)

    def sign_in(self, name: str, entered: str, pin: str, address: str, now_s: float) -> str | None:
        """Begin a session and return its token; None where the PIN is wrong. Ask `pause_s` before."""
        network = _network(address)
        if not hmac.compare_digest(entered.encode(), pin.encode()):
            before = self._failures.pop(network, None)
            self._failures[network] = _Failures(1 if before is None else before.count + 1, now_s)
            _limit(self._failures, MAX_ADDRESSES)
            return None
        self._failures.pop(network, None)
        token = secrets.token_urlsafe(32)
        self._sessions[token] = SignedInPerson(name, pin, now_s + EXPIRY_S)
        _limit(self._sessions, MAX_SESSIONS)
        return token

    def session(self, token: str | None, pin: str | None, now_s: float) -> SignedInPerson | None:
        """Return the session of a token; None where it has expired or the PIN was changed."""
        found = None if token is None else self._sessions.get(token)
        if found is None or found.until_s <= now_s or found.pin != pin:
            return None
        return found

    def sign_out(self, token: str | None) -> None:
        """End a session."""
        if token is not None:
            self._sessions.pop(token, None)


def _network(address: str) -> str:
    """Return what one person has of addresses: an IPv4 address, or the /64 network of an IPv6 address."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    return address if parsed.version == 4 else str(ipaddress.ip_network((parsed, 64), strict=False))


def _limit(entries: "OrderedDict[str, SignedInPerson] | OrderedDict[str, _Failures]", most: int) -> None:
    while len(entries) > most:
        entries.popitem(last=False)
