"""Shows that connections to the bus open no link, and keeps their number small where that is possible."""

from collections.abc import Sequence

import zenoh

from gateway.bus.silent_connections import KEPT, SilentConnections, raise_open_files
from gateway.daemon.runtime.faults import FaultRegister

PART = "bus_connections"
LOOKS = 3
"""Looks in a row, a second apart, at which there must be as many, or no more. Basis: a choice; a fleet that returns is no attack,
and an attack in waves is one."""


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
                PART,
                f"more than {KEPT} connections to the bus open no link; with tls/ nobody may get one, and links that exist are "
                f"cut for a moment where they become {self._most}; find who opens them (ss -tn), and keep them off by a firewall",
            )
        elif self._looks <= -LOOKS:
            self._faults.clear(PART)
