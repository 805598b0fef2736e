"""Server-Sent Events to many browsers: one encoded payload shared by all, a short queue each, the slow ones dropped."""

import asyncio
from collections.abc import AsyncIterator

from pydantic_core import to_json

RETRY_MS = 500
MOST_CLIENTS = 32
LONGEST_QUEUE = 20


def event(name: str, content: object, *, number: int) -> bytes:
    """One event; a number that is not finite becomes null, which every browser can read."""
    return b"id: %d\nevent: %s\ndata: %s\n\n" % (number, name.encode(), to_json(content, inf_nan_mode="null"))


class Client:
    """One browser's queue; None ends its stream."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[bytes | None] = asyncio.Queue(LONGEST_QUEUE)

    def end(self) -> None:
        """End the stream, forgetting what was not sent yet: it is old news."""
        while not self.queue.empty():
            self.queue.get_nowait()
        self.queue.put_nowait(None)


class EventStream:
    """The browsers that listen."""

    def __init__(self) -> None:
        self._clients: set[Client] = set()
        self._closed = False
        self.dropped = 0
        """Browsers dropped because they did not keep up."""

    def __len__(self) -> int:
        return len(self._clients)

    @property
    def full(self) -> bool:
        """No room for another browser."""
        return self._closed or len(self._clients) >= MOST_CLIENTS

    def publish(self, payload: bytes) -> None:
        """Hand one payload to every browser; never waits."""
        for client in list(self._clients):
            if client.queue.full():
                self.dropped += 1
                self._clients.discard(client)
                client.end()
            else:
                client.queue.put_nowait(payload)

    def close(self) -> None:
        """End all streams; no new ones."""
        self._closed = True
        for client in self._clients:
            client.end()
        self._clients.clear()

    async def stream(self, greeting: bytes) -> AsyncIterator[bytes]:
        """Events for one browser: the greeting, then what is published from now on."""
        if self.full:
            return
        client = Client()
        self._clients.add(client)
        try:
            yield b"retry: %d\n\n" % RETRY_MS + greeting
            while (payload := await client.queue.get()) is not None:
                yield payload
        finally:
            self._clients.discard(client)
