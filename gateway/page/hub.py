"""Server-Sent Events to several browsers: one encoded payload for all, a short queue for each; slow browsers are dropped."""

import asyncio
from collections.abc import AsyncIterator

from pydantic_core import to_json

RETRY_MS = 500
MOST_CLIENTS = 32
LONGEST_QUEUE = 20


def event(name: str, content: object, *, number: int) -> bytes:
    """Encode one event; a number that is not finite becomes null, which every browser can read."""
    return b"id: %d\nevent: %s\ndata: %s\n\n" % (number, name.encode(), to_json(content, inf_nan_mode="null"))


class BrowserQueue:
    """The payloads that one browser has not received yet; None ends its stream."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[bytes | None] = asyncio.Queue(LONGEST_QUEUE)

    def end(self) -> None:
        """End the stream and discard the payloads that were not sent: they are out of date."""
        while not self.queue.empty():
            self.queue.get_nowait()
        self.queue.put_nowait(None)


class EventStream:
    """The browsers that receive the events."""

    def __init__(self) -> None:
        self._browsers: set[BrowserQueue] = set()
        self._closed = False
        self.dropped = 0
        """Number of browsers that were dropped because they were too slow."""

    def __len__(self) -> int:
        return len(self._browsers)

    @property
    def full(self) -> bool:
        """Whether no other browser is admitted."""
        return self._closed or len(self._browsers) >= MOST_CLIENTS

    def publish(self, payload: bytes) -> None:
        """Add a payload to the queue of every browser; never waits."""
        for browser in list(self._browsers):
            if browser.queue.full():
                self.dropped += 1
                self._browsers.discard(browser)
                browser.end()
            else:
                browser.queue.put_nowait(payload)

    def close(self) -> None:
        """End all streams, and admit no new ones."""
        self._closed = True
        for browser in self._browsers:
            browser.end()
        self._browsers.clear()

    async def stream(self, greeting: bytes) -> AsyncIterator[bytes]:
        """Yield the events for one browser: the greeting, then everything that is published from now on."""
        if self.full:
            return
        browser = BrowserQueue()
        self._browsers.add(browser)
        try:
            yield b"retry: %d\n\n" % RETRY_MS + greeting
            while (payload := await browser.queue.get()) is not None:
                yield payload
        finally:
            self._browsers.discard(browser)
