"""Roles, the caller of a request once it is authenticated, and how often callers may ask: a burst, and a steady rate after it."""

from collections import OrderedDict
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from gateway.errors import PlumblineError

Scheme = Literal["token", "certificate", "page_pin"]
MAX_CALLERS = 256
"""Callers whose bucket is kept. Basis: a choice; more than a site has, and a bound of the memory."""


class Role(StrEnum):
    """What a caller may do. A service engineer may do everything that an operator may."""

    OPERATOR = "operator"
    """Read, acknowledge, mark."""
    SERVICE = "service"
    """Everything: also recalibrate, and change the configuration."""

    def includes(self, other: "Role") -> bool:
        """Return whether this role has the rights of another one."""
        return self is Role.SERVICE or self is other


@dataclass(frozen=True, slots=True)
class Caller:
    """An authenticated caller."""

    name: str | None
    """Common name of the certificate; None for a shared secret, whose holder states a name in the request."""
    role: Role
    scheme: Scheme
    asked_ns: int | None = None
    """Gateway time of the challenge that the caller answered: what came later it cannot have meant. None: there was none."""


class NotAuthorised(PlumblineError):  # noqa: N818  (not an error: the answer is no, and the text states why)
    """A request is refused before it is considered; the text states the reason and the remedy."""

    def __init__(self, kind: str, text: str, name: str | None = None) -> None:
        """`kind` groups refusals in counters; `name` is the authenticated or stated name, where there is one."""
        super().__init__(text)
        self.kind = kind
        self.name = name


def require_role(caller: Caller, role: Role) -> None:
    """Raise `NotAuthorised` where a caller has not the rights of a role."""
    if not caller.role.includes(role):
        raise NotAuthorised(
            "wrong_role", f"the role {caller.role} may not do this; it needs the role {role}", caller.name
        )


@dataclass(frozen=True, slots=True)
class RateLimit:
    """How many requests may come at once, and how many per second later."""

    burst: int
    per_s: float


class TokenBucket:
    """One bucket; it starts full."""

    def __init__(self, limit: RateLimit) -> None:
        self._limit = limit
        self._tokens = float(limit.burst)
        self._last_ns: int | None = None

    def take(self, now_ns: int) -> bool:
        """Take a token; return False where there is none."""
        if self._last_ns is not None:
            gained = (now_ns - self._last_ns) / 1e9 * self._limit.per_s
            self._tokens = min(self._tokens + max(gained, 0.0), float(self._limit.burst))
        self._last_ns = now_ns
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True


class CallerLimits:
    """A bucket for each caller, of the callers that came last."""

    def __init__(self, limit: RateLimit) -> None:
        self._limit = limit
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()

    def take(self, name: str, now_ns: int) -> bool:
        """Take a token of a caller; return False where there is none."""
        bucket = self._buckets.pop(name, None) or TokenBucket(self._limit)
        self._buckets[name] = bucket
        while len(self._buckets) > MAX_CALLERS:
            self._buckets.popitem(last=False)
        return bucket.take(now_ns)
