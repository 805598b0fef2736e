"""Freshness of credentials: each is good once, for a short time after its challenge, in one boot of one gateway."""

from collections import OrderedDict

from gateway.authorization.caller import NotAuthorised
from gateway.authorization.credential import RequestStatement

WINDOW_S = 30.0
"""Time after a challenge within which its credential must arrive. Basis: a link across a site needs a fraction of it."""
MAX_REMEMBERED = 1024
"""Credentials that are remembered; of older ones none is accepted, so that a flood cannot push one out and repeat it. Basis: a
choice; more than honest callers send in `WINDOW_S`, and a bound of the memory."""


class Freshness:
    """Remembers the statements that were proven. Times are those of the gateway, which never step."""

    def __init__(self, boot_id: str) -> None:
        self._boot_id = boot_id
        self._used: OrderedDict[RequestStatement, None] = OrderedDict()
        self._oldest_ns = -1
        """A credential must be newer than every one that was forgotten."""

    def check(self, boot_id: str, time_ns: int, now_ns: int) -> None:
        """Refuse a credential of another boot, an expired one, or one from the future. Raises `NotAuthorised`."""
        if boot_id != self._boot_id:
            raise NotAuthorised("stale_credential", "the credential is that of another boot of the gateway; repeat")
        if not 0 <= now_ns - time_ns <= WINDOW_S * 1e9 or time_ns <= self._oldest_ns:
            raise NotAuthorised("stale_credential", "the credential is too old; repeat the request")

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
