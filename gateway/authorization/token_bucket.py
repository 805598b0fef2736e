"""Rate limits by token buckets: a burst, and a steady rate after it."""

from collections import OrderedDict
from dataclasses import dataclass

MAX_CALLERS = 256
"""Callers whose bucket is kept. Basis: a choice; more than a site has, and a bound of the memory."""


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
