"""The wish to stop, which a signal handler may state at any time."""

import queue
import threading
from contextlib import suppress


class StopRequest(threading.Event):
    """An event that the handler of a signal may set.

    Python runs a handler in the main thread between two instructions: where that is inside `threading.Event.wait`, `set` waits
    for ever for a lock that its own thread holds. A `SimpleQueue` may be put to while it is put to or read from.
    """

    def __init__(self) -> None:
        super().__init__()
        self._is_stated = False
        self._wakings: queue.SimpleQueue[None] = queue.SimpleQueue()

    def is_set(self) -> bool:
        """Return whether anybody has asked to stop."""
        return self._is_stated

    def set(self) -> None:
        """Ask to stop, from a handler or any thread."""
        self._is_stated = True
        self._wakings.put(None)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait at most so many seconds until somebody asks to stop; return whether anybody has. For one thread at a time."""
        if not self._is_stated:
            with suppress(queue.Empty):
                self._wakings.get(timeout=timeout)
        return self._is_stated
