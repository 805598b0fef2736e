"""The nodes that a receiver hears: to find out that it hears all but the configured one."""

from devices.errors import DeviceError

FIRST_PATIENCE_NS, LATER_PATIENCE_NS = 2_500_000_000, 10_000_000_000
"""Before the wanted node was heard for the first time, which more often has a cause in the configuration, and later. Basis: a
choice; nodes at usual rates send several times per second, and a radio link returns within seconds."""
MAX_PATIENCE_NS = 600_000_000_000
"""A node may sleep for days beside others: each report doubles the time to the next one. Basis: a choice; ten minutes, a few
lines an hour."""
MAX_NODES = 32
"""Basis: a choice; more than a base station serves at one crane, and a bound of the memory."""


class HeardNodes:
    """Counts the frames of all nodes."""

    def __init__(self, wanted: int) -> None:
        self._wanted = wanted
        self._others: dict[int, int] = {}
        self._since_ns: int | None = None
        self._patience_ns = FIRST_PATIENCE_NS

    def restart(self) -> None:
        """Begin again, after the port was opened."""
        self._others.clear()
        self._since_ns = None

    def add(self, node: int, read_ns: int) -> bool:
        """Count a frame; return whether it is one of the wanted node."""
        if self._since_ns is None:
            self._since_ns = read_ns
        if node == self._wanted:
            self._since_ns = read_ns
            self._patience_ns = LATER_PATIENCE_NS
            return True
        if node in self._others or len(self._others) < MAX_NODES:
            self._others[node] = self._others.get(node, 0) + 1
        return False

    def check(self, read_ns: int) -> None:
        """Raise `DeviceError` when only frames of other nodes have come for some seconds."""
        if self._others and self._since_ns is not None and read_ns - self._since_ns > self._patience_ns:
            self._patience_ns = min(2 * self._patience_ns, MAX_PATIENCE_NS)
            heard = ", ".join(f"{node} ({count} frames)" for node, count in sorted(self._others.items()))
            raise DeviceError(f"node {self._wanted} is not heard; heard are {heard}; set device.node, or wake the node")
