"""The publishing thread: puts all messages but alerts on the bus. No other thread ever waits for a peer."""

import logging

import zenoh

from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.worker import Worker
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.topics import TOPICS

log = logging.getLogger("plumbline.bus")
INBOX = 2048
JSON = zenoh.Encoding.APPLICATION_JSON


class Publisher(Worker[EncodedMessage]):
    """Owns the bus session from start to stop."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        super().__init__("publisher", BoundedQueue(INBOX))
        self._session = session
        self._latest: dict[str, bytes] = {}
        self._publishers = {
            name: session.declare_publisher(
                f"{key}/{name}",
                encoding=JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.DATA,
            )
            for name, topic in TOPICS.items()
            if topic.published and name != "alert"
        }
        self._alive = session.liveliness().declare_token(f"{key}/alive")

    def latest(self) -> dict[str, bytes]:
        """Return the last published message of each topic. Called by any thread."""
        return dict(self._latest)

    def note_latest(self, topic: str, payload: bytes) -> None:
        """Take a message that another thread publishes, for the status."""
        self._latest[topic] = payload

    def handle(self, item: EncodedMessage) -> None:
        """Publish a message."""
        self.note_latest(item.topic, item.payload)
        try:
            self._publishers[item.topic].put(item.payload)
        except zenoh.ZError as error:
            log.error("%s could not be published: %s", item.topic, error)

    def close(self) -> None:
        """Close the session, which also withdraws the liveliness token."""
        self._session.close()
