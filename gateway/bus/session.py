"""Zenoh sessions that listen and connect only at the configured endpoints, with mutual TLS and bounded messages.

The access control of a gateway's own session denies what is not allowed. A rule allows a key expression that lies within its own,
so that a wildcard publication cannot slip past an allowed list, as it would past a list of denied keys. Messages are checked at
every link of this session; behind a router the router's rules hold.
"""

import json
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from gateway.configuration.bus_section import BusSection
from gateway.errors import PlumblineError, first_of
from gateway.topics import ALIVE, EVERY_KEY

READ = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")
WRITE = ("put", "delete", "declare_queryable", "reply", "liveliness_token")
EVERYTHING = "**"
LEASE_MS = 1500
"""A silent peer is noticed after about this time; with the library's 10 s a dead gateway would look alive. Basis: a choice; the
library sends a keep-alive four times in a lease, and three may be lost."""
RETRY_MS = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 2}
"""Pauses between attempts to connect, on average. Basis: a choice; a restart of a router is over soon, and a missing one costs
little."""
RETRY_SPREAD = 0.5
"""Share by which the pauses of each party differ, so that a fleet does not return to its router in step. Basis: a choice; the
pauses of a fleet then spread over one whole pause."""
FOREVER = -1
CLIENT_CONNECT_MS = 2000
"""Longest attempt of a gateway that is a client: the library waits in `open`, and the gateway repeats it without end. Basis: a
choice; several round trips of a radio link with TLS, and no late look for the end."""
LARGEST_MESSAGE = 65536
"""Largest message, bytes, that a gateway receives. Basis: a request or a load signal is smaller. The library's default is 1
GiB."""
LARGEST_ANSWER = 4_194_304
"""Largest message, bytes, that a client receives. Basis: an audit of a thousand lines, a record with its poses."""
LONGEST_BLOCKED_US = 1_000_000
"""A link that takes nothing for so long is closed, so that a stalled peer holds no answer to another one up. Basis: a choice; a
lost packet is repeated within less."""
MOST_PENDING = 4096
"""Connections that may be opening at the same time. Basis: measured; silent ones are ended each second (`silent_connections`), so
that 3000 new ones a second keep nobody out, and take 93 MB. The library's default is 100."""
ACCEPT_MS = 3000
"""A connection that has not opened a link by then is closed. Basis: a choice; longer than a client tries (`CLIENT_CONNECT_MS`).
The library's default is 10 s, for which silent connections keep their places."""
MOST_NAMED = 4
"""Basis: a choice; one line of a terminal."""


def access_control(bus: BusSection, key: str) -> dict[str, Any]:
    """Return the access control of the session of the gateway with a key."""
    access, forwarded = bus.access, [part for prefix in bus.forward for part in (prefix, f"{prefix}/**")]
    publications = [f"{key}/**", *forwarded]
    rules = [
        access_rule("send", WRITE, "egress", publications if not access.routers else [*publications, EVERY_KEY]),
        access_rule("ask_others", READ, "egress", [EVERYTHING]),
        access_rule("read", READ, "ingress", [EVERYTHING]),
        access_rule("load_signal", ("put",), "ingress", [f"{key}/load"]),
        access_rule("boot", ("liveliness_token",), "ingress", [f"{key}/{ALIVE}/**"]),
        access_rule("route", WRITE, "ingress", [EVERY_KEY]),
    ]
    if forwarded:
        rules.append(access_rule("forward", WRITE, "ingress", forwarded))
    subjects, policies = _policies(bus, ["forward"] if forwarded else [])
    return deny_all_but(rules, subjects, policies)


def _policies(bus: BusSection, forward: list[str]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the subjects, and the rules that are theirs."""
    access = bus.access
    readers = [*access.operators, *access.services]
    everybody = ["send", "ask_others", "boot", *forward]
    if not readers:
        everybody.append("read")
    if not access.load_signals:
        everybody.append("load_signal")
    named: tuple[tuple[str, Sequence[str], list[str]], ...] = (
        ("readers", readers, ["read"]),
        ("load_signals", access.load_signals, ["read", "load_signal"]),
        ("routers", access.routers, ["read", "load_signal", "route"]),
    )
    subjects: list[dict[str, Any]] = [{"id": "everybody"}]
    policies = [{"subjects": ["everybody"], "rules": everybody}]
    for subject, names, rules in named:
        if names:
            subjects.append({"id": subject, "cert_common_names": list(names)})
            policies.append({"subjects": [subject], "rules": rules})
    return subjects, policies


def deny_all_but(
    rules: list[dict[str, Any]], subjects: list[dict[str, Any]], policies: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the access control that denies what the rules do not allow to the subjects of their policies."""
    access = {"rules": rules, "subjects": subjects, "policies": policies}
    return {"enabled": True, "default_permission": "deny", **access}


def access_rule(name: str, messages: Sequence[str], flow: str, key_expressions: list[str]) -> dict[str, Any]:
    """Return a rule that allows messages of these kinds, in one direction of flow, within these key expressions."""
    return {
        "id": name,
        "messages": list(messages),
        "flows": [flow],
        "permission": "allow",
        "key_exprs": key_expressions,
    }


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """The certificates of one party, in PEM."""

    ca: Path
    certificate: Path | None
    key: Path | None

    def settings(self) -> dict[str, object]:
        """Return the library's settings: both sides present a certificate, and names are verified."""
        own = {
            f"{side}_{name}": str(path)
            for side in ("listen", "connect")
            for name, path in (("certificate", self.certificate), ("private_key", self.key))
            if path is not None
        }
        return {
            "root_ca_certificate": str(self.ca),
            **own,
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }


class BusError(PlumblineError):
    """The bus cannot be opened; the text names the endpoint and the remedy in one line."""


class UnreachableError(BusError):
    """Nobody answers at an endpoint of the right form: the command was right, and the answer is no."""

    exit_code = 1


def session_settings(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    tls: TlsFiles | None = None,
    connect_timeout_ms: int = FOREVER,
    largest_message: int = LARGEST_ANSWER,
    access: Mapping[str, Any] | None = None,
) -> zenoh.Config:
    """Return the settings of a session without multicast scouting, with mutual TLS where there are certificates.

    With `connect_timeout_ms` = `FOREVER` it keeps trying to connect in the background. `access` is its access control. Raises
    `BusError` for an endpoint of wrong form.
    """
    settings: dict[str, object] = {
        "mode": mode,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": connect_timeout_ms,
        "connect/exit_on_failure": connect_timeout_ms != FOREVER,
        "connect/retry": _spread_retry(),
        "listen/endpoints": list(listen),
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # without scouting there is nothing to wait for
        "timestamping/enabled": False,
        "transport/unicast/accept_pending": MOST_PENDING,
        "transport/unicast/accept_timeout": ACCEPT_MS,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": LONGEST_BLOCKED_US,
        "transport/link/rx/max_message_size": largest_message,
        "transport/shared_memory/enabled": False,
    }
    if tls is not None:
        settings |= {f"transport/link/tls/{name}": value for name, value in tls.settings().items()}
    if access is not None:
        settings["access_control"] = access
    config = zenoh.Config()
    try:
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
    except zenoh.ZError as error:
        raise BusError(_describe(connect, listen, error)) from error
    return config


def _spread_retry() -> dict[str, float]:
    """Return the pauses of this party: at random around the average."""
    share = random.uniform(1 - RETRY_SPREAD, 1 + RETRY_SPREAD)
    return {name: value if name.endswith("factor") else round(share * value) for name, value in RETRY_MS.items()}


def open_session(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    tls: TlsFiles | None = None,
    connect_timeout_ms: int = FOREVER,
) -> zenoh.Session:
    """Open a session. Raises `BusError` for an endpoint that cannot be used, `UnreachableError` without an answer in time."""
    return _open(session_settings(mode, connect, listen, tls, connect_timeout_ms), connect, listen)


def gateway_settings(bus: BusSection, key: str) -> zenoh.Config:
    """Return the settings of the session of the gateway with a key. Raises `BusError` for an endpoint of wrong form."""
    tls = bus.tls
    files = None if tls.ca is None else TlsFiles(tls.ca, tls.certificate, tls.key)
    return session_settings(
        bus.mode,
        bus.connect,
        bus.active_listeners,
        files,
        CLIENT_CONNECT_MS if bus.mode == "client" else FOREVER,
        largest_message=LARGEST_MESSAGE,
        access=access_control(bus, key),
    )


def open_gateway_session(bus: BusSection, key: str) -> zenoh.Session:
    """Open the session of the gateway with a key. Raises `BusError`."""
    return _open(gateway_settings(bus, key), bus.connect, bus.active_listeners)


def _open(config: zenoh.Config, connect: Sequence[str], listen: Sequence[str]) -> zenoh.Session:
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
        return (
            "nobody answers there; is the gateway running, and its bus.listen the same? With tls/... it answers only those "
            "whose certificate its CA has issued"
        )
    return text.split(" at ", 1)[0].strip().rstrip(".")


def describe_links(session: zenoh.Session) -> str:
    """Return the far ends of a session's links: common name where TLS has authenticated one, and address.

    A query does not carry its sender, so that with several links it came from one of them.
    """
    try:
        links = session.info.links()
    except zenoh.ZError:
        return "a link that is down"
    ends = sorted({f"{link.auth_identifier}, {link.dst}" if link.auth_identifier else str(link.dst) for link in links})
    return first_of(ends, MOST_NAMED, " or ") or "a link that is closed"
