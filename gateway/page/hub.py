"""Connections that are held, and Server-Sent Events to several browsers.

When there are too many connections, the oldest that is idle makes room, from the address that has most: so silent, half-sent or
forgotten ones never lock another person out, nor the person at the same address. An event is encoded once for all browsers, with
a short queue for each; slow browsers are dropped.
"""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable
from typing import Generic, Protocol, TypeVar

from pydantic_core import to_json

RECONNECT_MS = 500
"""Time after which a browser connects again. Basis: a choice; a person sees no pause, and a restart no flood."""
MAX_STREAMS = 96
"""Browsers with a stream. Basis: a choice; more than look at one crane, and a bound of the work."""
MAX_STREAMS_PER_ADDRESS = 40
"""Further browsers replace the oldest, so that forgotten or hostile streams lock nobody out. Basis: a choice; tabs and tablets
behind one proxy, and less than half of all."""
MAX_WAITING_PUSHES = 20
"""Pushes that wait for a browser. Basis: a choice; some seconds, after which its link counts as stalled."""


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


def event(name: str, content: object, *, number: int) -> bytes:
    """Encode one event; a number that is not finite becomes null, which every browser can read."""
    return b"id: %d\nevent: %s\ndata: %s\n\n" % (number, name.encode(), to_json(content, inf_nan_mode="null"))


class BrowserQueue:
    """The payloads that one browser has not received yet; None ends its stream."""

    idle = True
    """It may be ended at any time: the browser connects again."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.queue: asyncio.Queue[bytes | None] = asyncio.Queue(MAX_WAITING_PUSHES)

    def end(self) -> None:
        """End the stream and discard the payloads that were not sent: they are out of date."""
        while not self.queue.empty():
            self.queue.get_nowait()
        self.queue.put_nowait(None)


class EventStream:
    """The browsers that receive the events."""

    def __init__(self) -> None:
        self._browsers: ConnectionLimiter[BrowserQueue] = ConnectionLimiter(MAX_STREAMS, MAX_STREAMS_PER_ADDRESS)
        self._too_slow = 0
        self.closed = False

    def __len__(self) -> int:
        return len(self._browsers)

    @property
    def dropped(self) -> int:
        """Number of browsers that were dropped because they were too slow, or to make room."""
        return self._too_slow + self._browsers.ended

    def publish(self, payload: bytes) -> None:
        """Add a payload to the queue of every browser; never waits."""
        for browser in self._browsers.all():
            if browser.queue.full():
                self._too_slow += 1
                self._browsers.release(browser)
                browser.end()
            else:
                browser.queue.put_nowait(payload)

    def close(self) -> None:
        """End all streams, and admit no new ones."""
        self.closed = True
        for browser in self._browsers.all():
            browser.end()
            self._browsers.release(browser)

    async def stream(self, address: str, greet: Callable[[], bytes]) -> AsyncIterator[bytes]:
        """Yield the events for one browser: the greeting of the moment of its admission, then everything that is published."""
        browser = BrowserQueue(address)
        if self.closed or not self._browsers.admit(browser):
            return
        try:
            yield b"retry: %d\n\n" % RECONNECT_MS + greet()
            while (payload := await browser.queue.get()) is not None:
                yield payload
        finally:
            self._browsers.release(browser)
