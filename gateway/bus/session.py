"""Zenoh sessions that listen and connect only at the configured endpoints."""

import json
from collections.abc import Sequence
from pathlib import Path

import zenoh

from gateway.errors import PlumblineError

LEASE_MS = 2000
"""A silent peer is noticed after about this time; with the library's 10 s a dead gateway would look alive."""
RETRY_MS = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 2}
"""Pauses between attempts to connect."""
FOREVER = -1


class BusError(PlumblineError):
    """The bus cannot be opened; the text names the endpoint and the remedy in one line."""


class UnreachableError(BusError):
    """Nobody answers at an endpoint of the right form: the command was right, and the answer is no."""

    exit_code = 1


def session_settings(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    tls: dict[str, Path] | None = None,
    connect_timeout_ms: int = FOREVER,
) -> zenoh.Config:
    """Return the settings of a session without multicast scouting.

    With `connect_timeout_ms` = `FOREVER` it keeps trying to connect in the background. Raises `BusError` for an endpoint of
    wrong form.
    """
    settings: dict[str, object] = {
        "mode": mode,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": connect_timeout_ms,
        "connect/exit_on_failure": connect_timeout_ms != FOREVER,
        "connect/retry": RETRY_MS,
        "listen/endpoints": list(listen),
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # without scouting there is nothing to wait for
        "timestamping/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/shared_memory/enabled": False,
    }
    settings |= {f"transport/link/tls/{name}": str(path) for name, path in (tls or {}).items()}
    config = zenoh.Config()
    try:
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
    except zenoh.ZError as error:
        raise BusError(_describe(connect, listen, error)) from error
    return config


def open_session(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    tls: dict[str, Path] | None = None,
    connect_timeout_ms: int = FOREVER,
) -> zenoh.Session:
    """Open a session. Raises `BusError` for an endpoint that cannot be used, `UnreachableError` without an answer in time."""
    config = session_settings(mode, connect, listen, tls, connect_timeout_ms)
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        kind = UnreachableError if not listen and _is_unanswered(str(error)) else BusError
        raise kind(_describe(connect, listen, error)) from error


def _is_unanswered(text: str) -> bool:
    return "Timeout" in text or "Unable to connect" in text


def _describe(connect: Sequence[str], listen: Sequence[str], error: zenoh.ZError) -> str:
    return f"bus: {', '.join([*listen, *connect])}: {_explain(str(error))}"


def _explain(text: str) -> str:
    """Return the library's reason in an operator's words."""
    if "Address already in use" in text:
        return "the address is in use, by another gateway or a router; choose another bus.listen"
    if "Cannot assign requested address" in text:
        return "this machine has no such address; correct bus.listen"
    if "Endpoints must be of the form" in text:
        return "is not an endpoint; an endpoint has the form tcp/10.0.0.5:7447"
    if _is_unanswered(text):
        return "nobody answers there; is the gateway running, and its bus.listen the same?"
    return text.split(" at ", 1)[0].strip().rstrip(".")
