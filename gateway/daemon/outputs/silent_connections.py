"""Notices connections to the bus that open no link: whoever holds enough of them keeps everybody else from a link."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import zenoh

from gateway.bus.session import MOST_PENDING
from gateway.daemon.runtime.faults import FaultRegister

PART = "bus_connections"
MANY = MOST_PENDING // 4
"""Silent connections that are a fault. Basis: a choice; a fleet that returns opens its links within a second, and an attack is
named before it keeps anybody out."""
LOOKS = 3
"""Looks in a row, a second apart, at which there must be as many, or no more. Basis: a choice; a fleet that returns is no attack,
and an attack in waves is one."""
ESTABLISHED = "01"
TABLES = Path("/proc/net/tcp"), Path("/proc/net/tcp6")


class SilentConnections:
    """Compares the connections to the ports of the bus with its links."""

    def __init__(self, listeners: Sequence[str], faults: FaultRegister) -> None:
        """`listeners` are the endpoints on which the gateway listens."""
        self._ports = {f"{int(each.rpartition(':')[2]):04X}" for each in listeners if each.rpartition(":")[2].isdigit()}
        self._faults = faults
        self._looks = 0
        """How often in a row there were many; negative: few."""
        self._session: zenoh.Session | None = None

    def attach(self, session: zenoh.Session) -> None:
        """Watch a session from now on."""
        self._session = session

    def poll(self) -> None:
        """Set or clear the fault; call about once a second. Raises `zenoh.ZError`."""
        if self._session is None:
            return
        are_many = self._count() - len(self._session.info.links()) > MANY
        self._looks = max(self._looks, 0) + 1 if are_many else min(self._looks, 0) - 1
        if self._looks >= LOOKS:
            self._faults.set(
                PART,
                f"more than {MANY} connections to the bus open no link; {MOST_PENDING} of them keep everybody else out, while "
                "links that exist go on; find who opens them (ss -tn), and keep them off by a firewall",
            )
        elif self._looks <= -LOOKS:
            self._faults.clear(PART)

    def _count(self) -> int:
        """Return the number of established connections to the ports."""
        count = 0
        for table in TABLES:
            with suppress(OSError), table.open(encoding="ascii") as file:
                for line in file:
                    _, local, _, state, *_ = line.split(maxsplit=4)
                    count += state == ESTABLISHED and local.rpartition(":")[2] in self._ports
        return count
