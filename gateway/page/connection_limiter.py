"""Which connections are held: when there are too many, the oldest that is idle makes room, from the address that has most.

So silent, half-sent or forgotten connections never lock another person out, nor the person at the same address.
"""

from collections import Counter
from typing import Generic, Protocol, TypeVar


class Connection(Protocol):
    """Something that occupies a place."""

    @property
    def address(self) -> str:
        """Address of the peer."""

    @property
    def idle(self) -> bool:
        """Whether nothing is lost when it ends."""

    def end(self) -> None:
        """End it."""


Item = TypeVar("Item", bound=Connection)


class ConnectionLimiter(Generic[Item]):
    """The places of one kind, bounded in total and for each address."""

    def __init__(self, most: int, most_per_address: int) -> None:
        self._most = most
        self._most_per_address = most_per_address
        self._held: dict[Item, None] = {}
        self.ended = 0
        """Number that were ended to make room."""
        self.refused = 0

    def __len__(self) -> int:
        return len(self._held)

    def admit(self, item: Item) -> bool:
        """Take a place, if need be that of the oldest idle one; return False where there is none."""
        counts = Counter(held.address for held in self._held)
        if counts[item.address] >= self._most_per_address:
            candidates = [held for held in self._held if held.address == item.address]
        elif len(self._held) >= self._most:
            most = max(counts.values())
            candidates = [held for held in self._held if counts[held.address] == most]
        else:
            self._held[item] = None
            return True
        victim = next((held for held in candidates if held.idle), None)
        if victim is None:
            self.refused += 1
            return False
        self.release(victim)
        victim.end()
        self.ended += 1
        self._held[item] = None
        return True

    def release(self, item: Item) -> None:
        """Give a place back; nothing happens where it has none."""
        self._held.pop(item, None)

    def all(self) -> list[Item]:
        """Return all, oldest first."""
        return list(self._held)
