"""The router of a fleet: its configuration, for zenohd as a file, and for a session in router mode with its storage.

The storage is for a router that has no storage plug-in: the last message of each topic of each gateway, in memory.
"""

import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import zenoh

from gateway.bus.fleet_inbox import LARGEST_STATE_BYTES
from gateway.bus.session import (
    ACCEPT_MS,
    LARGEST_ANSWER,
    LEASE_MS,
    LONGEST_BLOCKED_US,
    MOST_PENDING,
    READ,
    WRITE,
    TlsFiles,
    access_rule,
    deny_all_but,
)
from gateway.bus.untrusted import GATEWAY_KEY, MOST_GATEWAYS, read_attachment
from gateway.topics import ANY_GATEWAY, EVERY_KEY, KEY_PREFIX, STATE_TOPICS

CLEANING = {"period": 3600, "lifespan": 86400}
"""Seconds between cleanings, and for which an unused entry lives. Basis: a choice; an hour and a day, so that nothing of a
running site is lost."""
MOST_BYTES = 128_000_000
"""Largest sum of all messages. Basis: a fleet of `MOST_GATEWAYS`, whose five messages have some ten kilobytes together, twice."""


def router_configuration(
    listen: Sequence[str],
    tls: TlsFiles | None = None,
    gateways: Mapping[str, str] | None = None,
    readers: Sequence[str] = (),
    load_signals: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the router's configuration; `gateways`: common name of each gateway's certificate by its key.

    With certificates everything is denied that is not allowed: a gateway publishes and answers under its own key alone, readers
    read and send requests, which each gateway authorises itself.
    """
    link: dict[str, Any] = {
        "tx": {
            "lease": LEASE_MS,
            "queue": {"congestion_control": {"block": {"wait_before_close": LONGEST_BLOCKED_US}}},
        },
        "rx": {"max_message_size": LARGEST_ANSWER},
    }
    configuration: dict[str, Any] = {
        "mode": "router",
        "listen": {"endpoints": list(listen)},
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},  # storages keep the newest message by its time stamp
        "transport": {
            "unicast": {"accept_pending": MOST_PENDING, "accept_timeout": ACCEPT_MS},
            "link": link,
            "shared_memory": {"enabled": False},
        },
    }
    if tls is not None:
        link["tls"] = tls.settings()
        configuration["access_control"] = _access(gateways or {}, readers, load_signals)
    return configuration


def with_storage(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Add zenohd's storage manager, which keeps the last messages in memory."""
    storages = {
        topic: {"key_expr": f"{ANY_GATEWAY}/{topic}", "volume": "memory", "garbage_collection": CLEANING}
        for topic in STATE_TOPICS
    }
    return {
        **configuration,
        "plugins_loading": {"enabled": True},
        "plugins": {"storage_manager": {"__required__": True, "storages": storages}},
    }


def _access(gateways: Mapping[str, str], readers: Sequence[str], load_signals: Sequence[str]) -> dict[str, Any]:
    rules = [
        access_rule("deliver", [*WRITE, *READ], "egress", [EVERY_KEY]),
        access_rule("read", READ, "ingress", [EVERY_KEY]),
        access_rule("load_signal", ["put"], "ingress", [f"{ANY_GATEWAY}/load"]),
    ]
    everybody = {"id": "everybody"}
    subjects: list[dict[str, Any]] = [everybody]
    policies: list[dict[str, Any]] = [{"subjects": ["everybody"], "rules": ["deliver"]}]
    for names, rule in ((readers, "read"), (load_signals, "load_signal")):
        if names:
            subjects.append({"id": f"{rule}ers", "cert_common_names": list(names)})
            policies.append({"subjects": [f"{rule}ers"], "rules": [rule]})
    for key, name in gateways.items():
        place = key.removeprefix(KEY_PREFIX)
        rules.append(access_rule(f"write {place}", [*WRITE, *READ], "ingress", [f"{key}/**"]))
        subjects.append({"id": place, "cert_common_names": [name]})
        policies.append({"subjects": [place], "rules": [f"write {place}"]})
    return deny_all_but(rules, subjects, policies)


class LatestStates:
    """Keeps the last messages in memory and answers queries for them, from `start` to `close`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._lock = threading.Lock()
        self._latest: dict[str, tuple[bytes, bytes | None]] = {}
        """Payload and signature by key."""
        self._bytes = 0
        patterns = [f"{ANY_GATEWAY}/{topic}" for topic in STATE_TOPICS]
        self._subscribers = [session.declare_subscriber(pattern, self._keep) for pattern in patterns]
        # The session may not be used inside its callbacks: each queryable has a channel and a thread.
        self._queryables = [session.declare_queryable(pattern) for pattern in patterns]
        self._threads = [
            threading.Thread(target=self._serve, args=(queryable,), name="latest-states", daemon=True)
            for queryable in self._queryables
        ]

    def start(self) -> None:
        """Begin to answer."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Take no more queries."""
        with suppress(zenoh.ZError):
            for queryable in self._queryables:
                queryable.undeclare()
            for subscriber in self._subscribers:
                subscriber.undeclare()

    def __len__(self) -> int:
        return len(self._latest)

    def _keep(self, sample: zenoh.Sample) -> None:
        key_expression, size = str(sample.key_expr), len(sample.payload)
        if sample.kind != zenoh.SampleKind.PUT or size > LARGEST_STATE_BYTES:
            return
        with self._lock:
            known = key_expression in self._latest or (
                len(self._latest) < MOST_GATEWAYS * len(STATE_TOPICS)
                and GATEWAY_KEY.fullmatch(key_expression.rpartition("/")[0]) is not None
            )
            before = len(self._latest[key_expression][0]) if key_expression in self._latest else 0
            if known and self._bytes + size - before <= MOST_BYTES:
                self._latest[key_expression] = sample.payload.to_bytes(), read_attachment(sample)
                self._bytes += size - before

    def _serve(self, queryable: "zenoh.Queryable[zenoh.handlers.Handler[zenoh.Query]]") -> None:
        with suppress(zenoh.ZError):  # the session is closed
            for query in queryable:
                self._answer(query)

    def _answer(self, query: zenoh.Query) -> None:
        with self._lock:
            kept = [(key, *each) for key, each in self._latest.items() if query.key_expr.intersects(zenoh.KeyExpr(key))]
        with query, suppress(zenoh.ZError):
            for key, payload, signature in kept:
                query.reply(key, payload, encoding=zenoh.Encoding.APPLICATION_JSON, attachment=signature)
