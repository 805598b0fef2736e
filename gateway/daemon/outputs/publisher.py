"""The publishing thread: puts all messages but alerts on the bus. No other thread ever waits for a peer."""

import logging

import zenoh

from gateway.authorization.message_signature import MessageSigner
from gateway.daemon.runtime.worker import BoundedQueue, Worker
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.topics import ALIVE, TOPICS

log = logging.getLogger("plumbline.bus")
MAX_WAITING_PUBLICATIONS = 2048
"""Messages that may wait. Basis: a choice; a minute at some thirty messages per second, and a bound of the memory."""
JSON = zenoh.Encoding.APPLICATION_JSON


class Publisher(Worker[EncodedMessage]):
    """Publishes while the bus is attached; without it the last message of each topic is kept."""

    def __init__(self, key: str, signer: MessageSigner) -> None:
        super().__init__("publisher", BoundedQueue(MAX_WAITING_PUBLICATIONS))
        self._key = key
        self._signer = signer
        self._latest: dict[str, bytes] = {}
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._alive: zenoh.LivelinessToken | None = None

    def attach(self, session: zenoh.Session) -> None:
        """Publish on a session from now on. Raises `zenoh.ZError`."""
        publishers = {
            name: session.declare_publisher(
                f"{self._key}/{name}",
                encoding=JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.DATA,
            )
            for name, topic in TOPICS.items()
            if topic.published and name != "alert"
        }
        self._alive = session.liveliness().declare_token(f"{self._key}/{ALIVE}")
        self._publishers = publishers

    def latest(self) -> dict[str, bytes]:
        """Return the last published message of each topic. Called by any thread."""
        return dict(self._latest)

    def note_latest(self, topic: str, payload: bytes) -> None:
        """Take a message that another thread publishes, for the status."""
        self._latest[topic] = payload

    def handle(self, item: EncodedMessage) -> None:
        """Publish a message."""
        self.note_latest(item.topic, item.payload)
        publisher = self._publishers.get(item.topic)
        if publisher is None:
            return
        signature = None
        if TOPICS[item.topic].signed:
            signature = self._signer.sign_message(f"{self._key}/{item.topic}", item.payload)
        try:
            publisher.put(item.payload, attachment=signature)
        except zenoh.ZError as error:
            log.error("%s could not be published: %s", item.topic, error)

    def close(self) -> None:
        """Nothing is owned: the end of the session also withdraws the liveliness token."""
