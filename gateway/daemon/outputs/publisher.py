"""The threads that send on the bus: alerts, each change after it was stored, and all other messages.

No other thread ever waits for a peer, and alerts wait for no other topic.
"""

import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace

import zenoh

from gateway.authorization.message_signature import MessageSigner
from gateway.daemon.runtime.worker import BoundedQueue, Worker
from gateway.daemon.storage.outbox_writer import OutboxWriter
from gateway.messages import Alert
from gateway.outbox import StoredChange
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.topics import ALIVE, TOPICS, encode

log = logging.getLogger("plumbline.bus")
MAX_WAITING_PUBLICATIONS = 2048
"""Messages that may wait. Basis: a choice; a minute at some thirty messages per second, and a bound of the memory."""
JSON = zenoh.Encoding.APPLICATION_JSON
alert_log = logging.getLogger("plumbline.alert_sender")
LATENCY_WINDOW_NS = 3600 * 10**9
"""Definition: the last hour, as the health says."""
MAX_KEPT_LATENCIES = 2048
"""Latencies that are kept. Basis: a choice; more than an hour of alerts has, and a bound of the memory."""
MAX_WAITING_ALERTS = 512
"""Alerts that may wait. Basis: a choice; several alerts per second for a minute."""
STORE_PATIENCE_S = 0.25
"""Longest delay of an alert by the disk. Basis: an SD card needs 5 to 50 ms, and an alert must not wait for a broken one."""


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


class AlertLatency:
    """Latencies of the last hour, at most `MAX_KEPT_LATENCIES`."""

    def __init__(self) -> None:
        self._latencies: deque[tuple[int, float]] = deque(maxlen=MAX_KEPT_LATENCIES)
        """(gateway time, latency in ms)"""

    def add(self, sample_ns: int, sent_ns: int) -> None:
        """Note a change, by the gateway times of its sample and of its sending."""
        self._latencies.append((sent_ns, (sent_ns - sample_ns) / 1e6))

    def summary_ms(self, now_ns: int) -> dict[str, float] | None:
        """Return count, median, 99th percentile and maximum; None without a change in the last hour."""
        latencies_ms = sorted(ms for sent_ns, ms in tuple(self._latencies) if now_ns - sent_ns <= LATENCY_WINDOW_NS)
        if not latencies_ms:
            return None
        count = len(latencies_ms)
        return {
            "count": count,
            "p50": round(latencies_ms[(count - 1) // 2], 3),
            "p99": round(latencies_ms[-(-99 * count // 100) - 1], 3),
            "max": round(latencies_ms[-1], 3),
        }


@dataclass(frozen=True, slots=True)
class QueuedAlert:
    """An alert message on its way to the bus."""

    message: Alert
    log_time_ns: int
    send_by_s: float
    """Monotonic time until which the disk is waited for."""
    stored: Future[bool] | None
    """Whether the change is on the disk; None for a heartbeat."""


class AlertSender(Worker[QueuedAlert]):
    """Sends alerts while the bus is attached; without it they are stored, and receivers fetch them later."""

    def __init__(
        self,
        key: str,
        outbox: OutboxWriter,
        now_ns: Callable[[], int],
        note_latest: Callable[[str, bytes], None],
        signer: MessageSigner,
    ) -> None:
        """`note_latest` takes each message for the status."""
        super().__init__("alerts", BoundedQueue(MAX_WAITING_ALERTS))
        self._key = f"{key}/alert"
        self._signer = signer
        self._outbox = outbox
        self._now_ns = now_ns
        self._note_latest = note_latest
        self._publisher: zenoh.Publisher | None = None
        self._is_last_stored = True
        self._latency = AlertLatency()
        self.not_sent = 0
        """Number of messages that the bus did not take."""
        self.sent_unstored = 0

    def attach(self, session: zenoh.Session) -> None:
        """Send on a session from now on. Raises `zenoh.ZError`."""
        self._publisher = session.declare_publisher(
            self._key,
            encoding=JSON,
            congestion_control=zenoh.CongestionControl.DROP,  # a receiver that stalls fetches what it has missed
            priority=zenoh.Priority.REAL_TIME,
            express=True,  # an alert does not wait for a batch to fill
        )

    def submit(self, message: Alert, log_time_ns: int, patience_s: float = 0.0) -> None:
        """Store and send a message, as soon as there is room within a time. Called by the processing thread."""
        stored = None
        if message.rule is not None and message.boot_id is not None and message.alert_number is not None:
            payload = encode(replace(message, stored=True))
            stored = self._outbox.submit(StoredChange(message.boot_id, message.alert_number, payload))
        queued = QueuedAlert(message, log_time_ns, time.monotonic() + STORE_PATIENCE_S, stored)
        if patience_s <= 0:
            self.inbox.put(queued)  # counts what it drops
        elif not self.inbox.put_waiting(queued, patience_s):
            self.not_sent += 1

    def latency_ms(self) -> dict[str, float] | None:
        """Return the latency from sample to sending over the last hour. Called by the processing thread."""
        return self._latency.summary_ms(self._now_ns())

    def handle(self, item: QueuedAlert) -> None:
        """Send a message, a change after it was stored; it is sent without where the disk takes too long."""
        if item.stored is not None:
            done = wait([item.stored], max(0.0, item.send_by_s - time.monotonic())).done
            self._is_last_stored = any(stored.result() for stored in done)
            self.sent_unstored += not self._is_last_stored
        payload = encode(replace(item.message, stored=self._is_last_stored))
        self._note_latest("alert", payload)
        if self._publisher is None:
            return
        try:
            self._publisher.put(payload, attachment=self._signer.sign_message(self._key, payload))
        except zenoh.ZError as error:
            self.not_sent += 1
            alert_log.error("an alert could not be sent: %s", error)
            return
        if item.stored is not None:
            self._latency.add(item.log_time_ns, self._now_ns())

    def close(self) -> None:
        """Nothing is owned: the session ends after all that use it."""
