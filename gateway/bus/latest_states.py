"""A storage of the last message of each topic of each gateway, for a router that has no storage plug-in."""

import threading
from contextlib import suppress

import zenoh

from gateway.bus.fleet_inbox import LARGEST_PAYLOAD, MOST_GATEWAYS
from gateway.bus.questions import read_attachment
from gateway.bus.untrusted import GATEWAY_KEY
from gateway.topics import STATE_TOPICS

MOST_BYTES = 128_000_000
"""Largest sum of all messages. Basis: a fleet of `MOST_GATEWAYS`, whose five messages have some ten kilobytes together, twice."""


class LatestStates:
    """Keeps the last messages in memory and answers queries for them, from `start` to `close`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._lock = threading.Lock()
        self._latest: dict[str, tuple[bytes, bytes | None]] = {}
        """Payload and signature by key."""
        self._bytes = 0
        patterns = [f"plumbline/v1/*/*/*/{topic}" for topic in STATE_TOPICS]
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
        if sample.kind != zenoh.SampleKind.PUT or size > LARGEST_PAYLOAD:
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
