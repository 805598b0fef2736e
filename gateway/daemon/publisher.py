"""The publishing thread: puts messages on the bus and answers status queries. The sampling thread never waits for a peer."""

import json
import logging

import zenoh

from gateway.daemon.worker import Worker
from gateway.pipeline.emission import Emission
from gateway.topics import TOPICS, encode

log = logging.getLogger("plumbline.bus")
INBOX = 2048
STATUS_TOPICS = tuple(name for name, topic in TOPICS.items() if topic.published and name != "samples")


class Publisher(Worker[Emission | zenoh.Query]):
    """Owns the bus session from start to stop."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        super().__init__("publisher", INBOX)
        self._session = session
        self._status_key = f"{key}/rpc/status"
        self._latest: dict[str, bytes] = {}
        self._publishers = {
            name: session.declare_publisher(
                f"{key}/{name}",
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.REAL_TIME if name == "alert" else zenoh.Priority.DATA,
                express=name == "alert",  # an alert is not held back for a batch
            )
            for name, topic in TOPICS.items()
            if topic.published
        }
        # The bus may not be called from its callbacks: a query joins the inbox and is answered by this thread.
        self._queryable = session.declare_queryable(self._status_key, self.inbox.put)
        self._alive = session.liveliness().declare_token(f"{key}/alive")

    def handle(self, item: Emission | zenoh.Query) -> None:
        """Put a message, or answer a query."""
        if isinstance(item, Emission):
            self._publish(item)
        else:
            self._answer(item)

    def _publish(self, emission: Emission) -> None:
        payload = encode(emission.topic, emission.message)
        if emission.topic in STATUS_TOPICS:
            self._latest[emission.topic] = payload
        try:
            self._publishers[emission.topic].put(payload)
        except zenoh.ZError as error:
            log.error("%s could not be put: %s", emission.topic, error)

    def _answer(self, query: zenoh.Query) -> None:
        status = {topic: json.loads(payload) for topic, payload in self._latest.items()}
        with query:
            query.reply(self._status_key, json.dumps(status), encoding=zenoh.Encoding.APPLICATION_JSON)

    def leave(self) -> None:
        """Leave the bus; the liveliness token goes with the session."""
        self._queryable.undeclare()
        self._session.close()
