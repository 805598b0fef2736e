"""The Zenoh side: subscribes to what the page shows. A client that never listens and waits for its gateway for ever."""

import json
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

import zenoh

from gateway.page.inbox import Arrival, Inbox
from gateway.topics import TOPICS

ALIVE = "alive"
SHOWN = tuple(topic.name for topic in TOPICS.values() if topic.published and topic.name != "samples")
"""Topics that the page subscribes to, each by itself: the raw samples stay out of this process."""
LARGEST_PAYLOAD = 65536

SETTINGS = {
    "mode": "client",
    "listen/endpoints": [],
    "scouting/multicast/enabled": False,
    "connect/timeout_ms": -1,
    "connect/exit_on_failure": False,
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 2},
    "transport/shared_memory/enabled": False,
}


def configuration(endpoints: list[str]) -> zenoh.Config:
    """Zenoh's configuration. Raises `ValueError` for an endpoint that is none."""
    config = zenoh.Config()
    try:
        for path, value in {**SETTINGS, "connect/endpoints": endpoints}.items():
            config.insert_json5(path, json.dumps(value))
    except zenoh.ZError as error:
        raise ValueError(f"connect: {endpoints}: {error}") from None
    return config


class Link:
    """Opens the session in a thread of its own: opening takes as long as the gateway is away."""

    def __init__(self, config: zenoh.Config, key: str, inbox: Inbox, on_failure: Callable[[str], object]) -> None:
        self._config = config
        self._key = key
        self._inbox = inbox
        self._on_failure = on_failure
        self._lock = threading.Lock()
        self._session = ExitStack()
        self._closed = False

    def start(self) -> None:
        """Begin to connect; returns at once."""
        threading.Thread(target=self._open, name="zenoh-open", daemon=True).start()

    def close(self) -> None:
        """Close the session: one with a callback that is left open would hang the exit."""
        with self._lock:
            self._closed = True
            self._session.close()

    def _open(self) -> None:
        try:
            session = zenoh.open(self._config)
            with self._lock:
                self._session.enter_context(session)
                if self._closed:
                    self._session.close()
                else:
                    self._subscribe(session)
        except zenoh.ZError as error:
            self._on_failure(str(error))

    def _subscribe(self, session: zenoh.Session) -> None:
        for topic in SHOWN:
            session.declare_subscriber(f"{self._key}/{topic}", self._receiver(topic))
        session.liveliness().declare_subscriber(f"{self._key}/{ALIVE}", self._alive, history=True)

    def _receiver(self, topic: str) -> Callable[[zenoh.Sample], None]:
        def receive(sample: zenoh.Sample) -> None:
            if len(sample.payload) > LARGEST_PAYLOAD:
                self._inbox.refuse()
            elif sample.kind == zenoh.SampleKind.PUT:
                self._inbox.put(topic, Arrival(sample.payload.to_bytes(), time.monotonic()))

        return receive

    def _alive(self, sample: zenoh.Sample) -> None:
        present = b"1" if sample.kind == zenoh.SampleKind.PUT else b""
        self._inbox.put(ALIVE, Arrival(present, time.monotonic()))
