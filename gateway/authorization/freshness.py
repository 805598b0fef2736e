"""Freshness of credentials: each is good once, for a short time after its challenge, in one boot of one gateway.

The time of a challenge is authentic: its last bits are a code of the others by a secret of this boot. Who passes messages on can
therefore not invent the challenge of a later time, have it signed, and keep the request until then; and nothing has to be
remembered of the challenges that were given out.
"""

import hashlib
import hmac
import secrets
from collections import OrderedDict

from gateway.authorization.caller import NotAuthorised
from gateway.authorization.credential import RequestStatement

WINDOW_S = 30.0
"""Time after a challenge within which its credential must arrive. Basis: a link across a site needs a fraction of it."""
MAX_REMEMBERED = 1024
"""Credentials that are remembered; of older ones none is accepted, so that a flood cannot push one out and repeat it. Basis: a
choice; more than honest callers send in `WINDOW_S`, and a bound of the memory."""
CODE_BITS = 24
"""Bits of the code. Basis: a choice; a guess is right once in 17 million times, a caller signs one challenge for each request,
and 2^24 ns, 17 ms, is the step of the time that is left."""


class Freshness:
    """Remembers the statements that were proven. Times are those of the gateway, which never step."""

    def __init__(self, boot_id: str) -> None:
        self._boot_id = boot_id
        self._secret = secrets.token_bytes(32)
        self._used: OrderedDict[RequestStatement, None] = OrderedDict()
        self._oldest_ns = -1
        """A credential must be newer than every one that was forgotten."""

    def issue(self, now_ns: int) -> int:
        """Return the time of a challenge: at most two steps of `CODE_BITS` before now, with its code."""
        return self._with_code(max((now_ns >> CODE_BITS) - 1, 0))

    def _with_code(self, step: int) -> int:
        code = hmac.digest(self._secret, step.to_bytes(8, "big"), hashlib.sha256)
        return (step << CODE_BITS) | (int.from_bytes(code[:8], "big") >> (64 - CODE_BITS))

    def check(self, boot_id: str, time_ns: int, now_ns: int) -> None:
        """Refuse a credential of another boot, an expired or invented one, or one from the future. Raises `NotAuthorised`."""
        if boot_id != self._boot_id:
            raise NotAuthorised("stale_credential", "the credential is that of another boot of the gateway; repeat")
        if not 0 <= now_ns - time_ns <= WINDOW_S * 1e9 or time_ns <= self._oldest_ns:
            raise NotAuthorised("stale_credential", "the credential is too old; repeat the request")
        if time_ns != self._with_code(time_ns >> CODE_BITS):
            raise NotAuthorised(
                "stale_credential", "the credential answers a challenge that this gateway has not given"
            )

    def use(self, statement: RequestStatement) -> None:
        """Use up what an authentic credential has proven. Raises `NotAuthorised` where it was used before."""
        if statement in self._used:
            raise NotAuthorised(
                "replayed_credential", "the credential was used before; repeat the request with a new one"
            )
        self._used[statement] = None
        while len(self._used) > MAX_REMEMBERED:
            forgotten, _ = self._used.popitem(last=False)
            self._oldest_ns = max(self._oldest_ns, forgotten.time_ns)
