"""A Zenoh session that listens and connects only where it was told to."""

import json
from collections.abc import Sequence
from pathlib import Path

import zenoh

from gateway.errors import PlumblineError

LEASE_MS = 2000
"""A silent peer is noticed after about this; the library's 10 s would leave a dead gateway looking alive."""


class BusError(PlumblineError):
    """The bus cannot be opened; the text names the endpoint and the mend in one line."""


def open_session(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    tls: dict[str, Path] | None = None,
    connect_timeout_ms: int = -1,
) -> zenoh.Session:
    """A session without multicast scouting, patient with a router that is down.

    `connect_timeout_ms` -1 tries for ever in the background; otherwise raises `BusError` when nobody answers in time.
    Raises `BusError` for an endpoint that cannot be used.
    """
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": mode,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": connect_timeout_ms,
        "connect/exit_on_failure": connect_timeout_ms >= 0,
        "listen/endpoints": list(listen),
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # without scouting there is nothing to wait for
        "timestamping/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/shared_memory/enabled": False,
    }
    settings |= {f"transport/link/tls/{name}": str(path) for name, path in (tls or {}).items()}
    try:
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise BusError(f"bus: {', '.join([*listen, *connect])}: {_explain_error(str(error))}") from error


def _explain_error(text: str) -> str:
    """The library's reason in an operator's words."""
    if "Address already in use" in text:
        return "the address is in use, by another gateway or a router; choose another bus.listen"
    if "Cannot assign requested address" in text:
        return "this machine has no such address; correct bus.listen"
    if "Timeout" in text or "Unable to connect" in text:
        return "nobody answers there; is the gateway running, and its bus.listen the same?"
    return text.split(" at ", 1)[0].strip().rstrip(".")
