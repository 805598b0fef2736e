"""The link of a bridge to its gateway: it is sought again for ever, and asked at any time what is known."""

import logging
import threading
import time
from collections.abc import Sequence
from datetime import UTC, datetime

import zenoh

from gateway.bridge.heard_messages import READ_TOPICS, HeardMessages
from gateway.bridge.plant_snapshot import STATE_CODES, PlantSnapshot, PlantState
from gateway.bus.alert_receiver import AlertReceiver
from gateway.bus.credentials import Credentials
from gateway.bus.fleet_client import FleetClient
from gateway.bus.fleet_inbox import FleetBatch, FleetInbox
from gateway.bus.session import UnreachableError

log = logging.getLogger("plumbline.bridge")
RETRY_S = 0.5
"""Pause before the next attempt to connect. Basis: a choice; a gateway that starts is found at once, and it costs little."""
LINK_LOOK_S = 0.1
"""Time between two looks at the link. Basis: a choice; a tenth of the heartbeat."""


class GatewayReader:
    """Reads one gateway. A thread only opens the session; what was heard is judged by who asks."""

    def __init__(
        self,
        connect: str,
        key: str,
        credentials: Credentials | None,
        heard: HeardMessages,
        *,
        topics: Sequence[str] = READ_TOPICS,
        inbox: FleetInbox | None = None,
    ) -> None:
        """`heard`: judges the messages; `inbox`: takes those of `topics`, where a bridge needs more than the newest.

        Raises `BusError` for an endpoint that cannot be used.
        """
        self.key = key
        self._topics, self._inbox = topics, inbox
        self._connect, self._credentials = connect, credentials
        self._heard = heard
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._linked = False
        self._state: PlantState | None = None
        self._looked_s = float("-inf")
        self._client: FleetClient | None = None
        self._seeker = threading.Thread(target=self._seek, name="bridge-link", daemon=True)
        if not self._open():
            self._seeker.start()

    def snapshot(self) -> PlantSnapshot:
        """Return what is known now. Any thread may ask."""
        with self._lock:
            now_s, client = time.monotonic(), self._client
            if client is not None and now_s - self._looked_s >= LINK_LOOK_S:
                was_linked, self._linked, self._looked_s = self._linked, client.connected, now_s
                if self._linked and not was_linked:
                    client.request_latest()  # the calibration comes every ten seconds only
            batch = FleetBatch() if client is None else client.receive()
            self._heard.take(batch, now_s, is_linked=self._linked)
            snapshot = self._heard.snapshot(time.monotonic(), datetime.now(UTC))
            if snapshot.state is not self._state:
                self._state = snapshot.state
                log.info("%s: %s: %s", self.key, snapshot.state, STATE_CODES[snapshot.state].meaning)
            return snapshot

    def receive_alerts(self, position: str) -> AlertReceiver:
        """Return a receiver of the alerts behind a position, over the same link. Raises `InputError` for one that is none."""
        return AlertReceiver(
            self._connect, self.key, states=position, credentials=self._credentials, session=self._session
        )

    def _session(self) -> zenoh.Session:
        if self._client is None:
            raise UnreachableError(f"{self._connect}: nobody has answered yet")
        return self._client.session

    def close(self) -> None:
        """Leave the bus."""
        self._closing.set()
        if self._client is not None:
            self._client.close()

    def _open(self) -> bool:
        """Open the session, which from then on restores a lost link by itself; return False where nobody answers."""
        try:
            client = FleetClient(self._connect, self.key, self._credentials, self._topics, self._inbox)
        except UnreachableError:
            return False
        with self._lock:
            self._client = client
        return True

    def _seek(self) -> None:
        while not self._closing.wait(RETRY_S) and not self._open():
            pass
