"""The table of verbs: what may be asked of a gateway, by whom, with which content, and how often.

Authorisation, limits, audit, answers and the documentation follow from it. A new verb is a row here and a handler in the daemon.
"""

from dataclasses import dataclass

from pydantic import BaseModel

from gateway.authorization.caller import RateLimit, Role
from gateway.recalibration import requests

READ_LIMIT = RateLimit(burst=100, per_s=50.0)
"""For all callers together: who only reads is not authenticated by the request. Basis: a choice; a fleet of clients that each ask
once per second, and less than a core."""
CHALLENGE_LIMIT = RateLimit(burst=1000, per_s=1000.0)
"""It costs little, and without it a flood of other requests would keep everybody from proving who they are. Basis: a choice; more
than a flood over a slow link, and a small share of a core."""
CHANGE_LIMIT = RateLimit(burst=20, per_s=2.0)
"""For each caller. Basis: a choice; a person and their tool send less, and each change costs a write."""


@dataclass(frozen=True, slots=True)
class Verb:
    """One row: the name in `<gateway>/rpc/<name>`, the role that it needs, the content of its payload, its limits."""

    name: str
    request: type[BaseModel]
    role: Role | None
    """None: it changes nothing, and whoever the bus admits may ask."""
    limit: RateLimit
    max_bytes: int = requests.MAX_PAYLOAD_BYTES
    """Largest payload."""


def _read(name: str, request: type[BaseModel] = requests.NoContent) -> Verb:
    return Verb(name, request, None, READ_LIMIT)


def _change(name: str, request: type[requests.Request], role: Role) -> Verb:
    return Verb(name, request, role, CHANGE_LIMIT)


VERBS: dict[str, Verb] = {
    verb.name: verb
    for verb in (
        _read("status"),
        Verb("challenge", requests.NoContent, None, CHALLENGE_LIMIT),
        _read("schema", requests.FetchSchema),
        _read("fetch", requests.Fetch),
        _read("alerts", requests.FetchAlerts),
        _change("acknowledge", requests.Acknowledge, Role.OPERATOR),
        _change("mark", requests.SetMark, Role.OPERATOR),
        _change("config_get", requests.ReadConfiguration, Role.SERVICE),
        _change("config_propose", requests.ProposeConfiguration, Role.SERVICE),
        _change("config_apply", requests.ApplyConfiguration, Role.SERVICE),
        *(_change(name, request, Role.SERVICE) for name, request in requests.VERBS.items()),
    )
}
"""The verbs by name."""
