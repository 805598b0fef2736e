"""The page's connection to the bus: a client that never listens and waits for its gateway without limit."""

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

import zenoh

from gateway.page.inbox import Arrival, Inbox
from gateway.topics import TOPICS

ALIVE = "alive"
SHOWN = tuple(topic.name for topic in TOPICS.values() if topic.published and topic.name != "samples")
"""Topics that the page subscribes to one by one, so that the raw samples do not reach this process."""
LARGEST_PAYLOAD = 65536


class Link:
    """Subscribes to the topics. The session is opened in a thread of its own, for that takes until the gateway answers."""

    def __init__(self, config: zenoh.Config, key: str, inbox: Inbox, on_failure: Callable[[str], object]) -> None:
        self._config = config
        self._key = key
        self._inbox = inbox
        self._on_failure = on_failure
        self._lock = threading.Lock()
        self._session = ExitStack()
        self._closed = False

    def start(self) -> None:
        """Begin to connect, without waiting."""
        threading.Thread(target=self._open, name="zenoh-open", daemon=True).start()

    def close(self) -> None:
        """Close the session. An open session with a callback would block the end of the process."""
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
                self._inbox.count_refused()
            elif sample.kind == zenoh.SampleKind.PUT:
                self._inbox.put(topic, Arrival(sample.payload.to_bytes(), time.monotonic()))

        return receive

    def _alive(self, sample: zenoh.Sample) -> None:
        present = b"1" if sample.kind == zenoh.SampleKind.PUT else b""
        self._inbox.put(ALIVE, Arrival(present, time.monotonic()))
