"""Server-Sent Events to several browsers: one encoded payload for all, a short queue for each; slow browsers are dropped."""

import asyncio
from collections.abc import AsyncIterator

from pydantic_core import to_json

from gateway.page.connection_limiter import ConnectionLimiter

RECONNECT_MS = 500
"""Time after which a browser connects again. Basis: a choice; a person sees no pause, and a restart no flood."""
MAX_STREAMS = 96
"""Browsers with a stream. Basis: a choice; more than look at one crane, and a bound of the work."""
MAX_STREAMS_PER_ADDRESS = 40
"""Further browsers replace the oldest, so that forgotten or hostile streams lock nobody out. Basis: a choice; tabs and tablets
behind one proxy, and less than half of all."""
MAX_WAITING_PUSHES = 20
"""Pushes that wait for a browser. Basis: a choice; some seconds, after which its link counts as stalled."""


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

    async def stream(self, address: str, greeting: bytes) -> AsyncIterator[bytes]:
        """Yield the events for one browser: the greeting, then everything that is published from now on."""
        browser = BrowserQueue(address)
        if self.closed or not self._browsers.admit(browser):
            return
        try:
            yield b"retry: %d\n\n" % RECONNECT_MS + greeting
            while (payload := await browser.queue.get()) is not None:
                yield payload
        finally:
            self._browsers.release(browser)
