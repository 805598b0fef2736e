"""Connections to the listeners of a session that open no link: whoever holds enough of them keeps everybody else from one.

The library ends each after seconds, which is too late. Beyond a number, those without encryption are ended here, the newest of
each address last: somebody who opens a link needs a fraction of a second, and is the newest of his own. Those with TLS are only
counted: the library takes 0.1 s for each that ends in its handshake, and lets nobody in meanwhile (eclipse-zenoh/zenoh#2685).
"""

import os
import resource
import socket
import stat
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path

import zenoh

from gateway.configuration.bus_section import is_encrypted

KEPT = 128
"""Silent connections that are kept. Basis: a choice; a fleet that returns opens its links within a second, and each costs some 20
kB."""
OPEN_FILES = 8192
"""Files that a process with listeners may have open. Basis: a choice; 3000 silent connections a second find room, and the memory
is bounded. The usual limit is 1024."""
OPEN_STATES = ("01", "08")
"""Established, and closed by the other end alone: what the library has not got round to closing."""
_BYTE_ORDER = sys.byteorder
TABLES = Path("/proc/net/tcp"), Path("/proc/net/tcp6")
Address = IPv4Address | IPv6Address
Peer = tuple[Address, int]


@dataclass(frozen=True, slots=True)
class _Connection:
    port: int
    """Of the listener."""
    peer: Peer
    inode: int
    """Of its socket; it grows with time."""


class SilentConnections:
    """Compares the connections to the ports of a session with its links."""

    def __init__(self, listeners: Sequence[str]) -> None:
        """`listeners` are the endpoints on which the session listens."""
        ports = [(each, each.rpartition(":")[2]) for each in listeners]
        self._ports = {int(port): is_encrypted(endpoint) for endpoint, port in ports if port.isdigit()}
        """Of the listeners, and whether they are encrypted."""
        self._tables = []
        for table in TABLES:  # kept open: there may be no file left to open when they are needed
            with suppress(OSError):
                self._tables.append(table.open(encoding="ascii"))

    def end_excess(self, session: zenoh.Session) -> int:
        """End unencrypted connections beyond those that are kept; return how many silent ones there were; 0: few.

        Raises `zenoh.ZError`.
        """
        connections = list(self._established())
        if len(connections) <= KEPT:
            return 0
        linked = {
            _peer_of(link.dst) for link in session.info.links()
        }  # after the table: who has just opened one is there
        silent = [each for each in connections if each.peer not in linked]
        open_ones = [each for each in silent if not self._ports[each.port]]
        if excess := {each.inode for each in _newest_of_each_address(open_ones)[KEPT:]}:
            for descriptor in range(OPEN_FILES):
                _end(descriptor, excess)
        return len(silent)

    def _established(self) -> Iterator[_Connection]:
        for table in self._tables:
            with suppress(OSError):
                table.seek(0)
                for line in table:
                    _, local, remote, state, *rest = line.split()
                    if state in OPEN_STATES and (port := int(local.rpartition(":")[2], 16)) in self._ports:
                        yield _Connection(port, _read_peer(remote), int(rest[5]))


def raise_open_files() -> int:
    """Let this process open as many files as `OPEN_FILES`, where it may; return how many it may open."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < OPEN_FILES:
        with suppress(OSError, ValueError):  # a service may not, and has its limit from `LimitNOFILE`
            resource.setrlimit(resource.RLIMIT_NOFILE, (min(OPEN_FILES, hard), hard))
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def _newest_of_each_address(connections: Iterable[_Connection]) -> list[_Connection]:
    """Return first the newest connection of each address, then the second ones, and so on."""
    seen: defaultdict[Address, int] = defaultdict(int)
    ranked = []
    for each in sorted(connections, key=lambda one: -one.inode):
        ranked.append((seen[each.peer[0]], -each.inode, each))
        seen[each.peer[0]] += 1
    return [each for _, _, each in sorted(ranked, key=lambda one: one[:2])]


def _end(descriptor: int, inodes: set[int]) -> None:
    """Shut a socket of the library down, which then closes it."""
    with suppress(OSError):
        status = os.fstat(descriptor)
        if stat.S_ISSOCK(status.st_mode) and status.st_ino in inodes:
            connection = socket.socket(fileno=descriptor)
            try:
                connection.shutdown(socket.SHUT_RDWR)
            finally:
                connection.detach()


def _read_peer(text: str) -> Peer:
    """Return address and port of a line of the kernel: words of 32 bits in the order of this machine's bytes."""
    address, _, port = text.partition(":")
    words = [int(address[start : start + 8], 16) for start in range(0, len(address), 8)]
    return _plain(ip_address(b"".join(word.to_bytes(4, _BYTE_ORDER) for word in words))), int(port, 16)


def _peer_of(locator: str) -> Peer | None:
    """Return address and port of a link's other end; None where it has none."""
    host, _, port = locator.partition("/")[2].rpartition(":")
    with suppress(ValueError):
        return _plain(ip_address(host.strip("[]").partition("%")[0])), int(port)
    return None


def _plain(address: Address) -> Address:
    mapped = address.ipv4_mapped if isinstance(address, IPv6Address) else None
    return mapped or address
