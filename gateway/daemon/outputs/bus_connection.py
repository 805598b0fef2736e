"""The connection to the bus, opened in a thread of its own, because that may take until a router answers.

The thread then looks whether connections to the bus open no link, and keeps their number small where that is possible.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence

import zenoh

from gateway.bus.session import BusError
from gateway.bus.silent_connections import KEPT, SilentConnections, raise_open_files
from gateway.daemon.runtime.worker import RETRYING, Backoff, FaultRegister

log = logging.getLogger("plumbline.bus")
MIN_OPENING_PAUSE_S, MAX_OPENING_PAUSE_S = 0.5, 5.0
"""Pauses between two attempts to open the bus, the first and the longest. Basis: a choice; a restart of the router is over soon,
and a missing one costs little."""
WATCH_S = 1.0
"""Time between two looks at the open bus. Basis: a choice; what is looked for is a fault after seconds."""
MAX_KEY_WAIT_S, KEY_POLL_S = 2.0, 0.02
"""Longest wait for the key before the bus is opened, and time between two looks. Basis: a choice; a slow card makes a new key
within it, and a disk that hangs delays alerts no longer."""
PART = "bus"
SILENT_CONNECTIONS = "bus_connections"
LOOKS = 3
"""Looks in a row, a second apart, at which there must be as many, or no more. Basis: a choice; a fleet that returns is no attack,
and an attack in waves is one."""


class BusConnection(threading.Thread):
    """Opens the session, with growing pauses between the attempts, and closes it at the end."""

    def __init__(
        self,
        open_session: Callable[[], zenoh.Session],
        users: Sequence[Callable[[zenoh.Session], None]],
        watches: Sequence[Callable[[], None]],
        key_tried: threading.Event,
        faults: FaultRegister,
        must_reopen: Callable[[], bool] = lambda: False,
    ) -> None:
        """`users` are called with the session once it is open, and not before; `watches` about once a second from then on.

        `key_tried` is waited for: what is sent before the key is loaded is not signed, and receivers do not believe it.
        `must_reopen` is asked after these; the session is then closed and opened anew, for the same users.
        """
        super().__init__(name="bus", daemon=True)
        self._open_session = open_session
        self._users = users
        self._watches = watches
        self._key_tried = key_tried
        self._faults = faults
        self._must_reopen = must_reopen
        self._stopping = threading.Event()
        self.tried = threading.Event()
        """Set after the first attempt."""

    def stop(self) -> None:
        """Ask the thread to close the session and end."""
        self._stopping.set()

    def run(self) -> None:
        """Open the session, pass it on, and close it when told to stop."""
        backoff = Backoff(MIN_OPENING_PAUSE_S, MAX_OPENING_PAUSE_S)
        end_s = time.monotonic() + MAX_KEY_WAIT_S
        while not self._key_tried.wait(KEY_POLL_S) and time.monotonic() < end_s and not self._stopping.is_set():
            pass
        while not self._stopping.is_set():
            session = self._try_open()
            self.tried.set()
            if session is not None:
                self._watch_until_end()
                session.close()
                continue
            self._stopping.wait(backoff.pause_s)
            backoff.increase()

    def _watch_until_end(self) -> None:
        while not self._stopping.wait(WATCH_S):
            self._watch()
            if self._must_reopen():
                log.error("the bus is closed and opened again: connections to it that open no link take too many files")
                return

    def _watch(self) -> None:
        for watch in self._watches:
            try:
                watch()
            except zenoh.ZError as error:
                log.error("the bus cannot be watched: %s", error)

    def _try_open(self) -> zenoh.Session | None:
        try:
            session = self._open_session()
        except BusError as error:
            self._faults.set(PART, f"{error}; {RETRYING}")
            return None
        try:
            for use in self._users:
                use(session)
        except zenoh.ZError as error:
            self._faults.set(PART, f"bus: {error}; {RETRYING}")
            session.close()
            return None
        self._faults.clear(PART)
        return session


class SilentConnectionWatch:
    """Looks at the connections to the bus."""

    def __init__(self, listeners: Sequence[str], faults: FaultRegister) -> None:
        """`listeners` are the endpoints on which the gateway listens."""
        self._listeners = listeners
        self._connections: SilentConnections | None = None
        self._most = raise_open_files() // 2
        self._faults = faults
        self._looks = 0
        """How often in a row there were many; negative: few."""
        self._session: zenoh.Session | None = None
        self.are_too_many = False
        """They take half of the files that the gateway may open: the session must be closed, or recording ends."""

    def attach(self, session: zenoh.Session) -> None:
        """Watch a session from now on."""
        self._session, self.are_too_many = session, False
        self._connections = self._connections or SilentConnections(self._listeners)

    def poll(self) -> None:
        """Set or clear the fault; call about once a second. Raises `zenoh.ZError`."""
        if self._session is None or self._connections is None:
            return
        count = self._connections.end_excess(self._session)
        self.are_too_many = count > self._most
        are_many = count > KEPT
        self._looks = max(self._looks, 0) + 1 if are_many else min(self._looks, 0) - 1
        if self._looks >= LOOKS or self.are_too_many:
            self._faults.set(
                SILENT_CONNECTIONS,
                f"more than {KEPT} connections to the bus open no link; with tls/ nobody may get one, and links that exist are "
                f"cut for a moment where they become {self._most}; find who opens them (ss -tn), and keep them off by a firewall",
            )
        elif self._looks <= -LOOKS:
            self._faults.clear(SILENT_CONNECTIONS)
