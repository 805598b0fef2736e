"""Requests on their way to the thread that carries them out; each is answered once, by that thread or instead of it."""

import threading
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from gateway.daemon.remote_request import RemoteRequest

BUSY = "busy: too many requests are waiting"
HANGS = "the disk does not answer"


class RequestQueue:
    """At most `size` requests, and the present one. `refuse` answers what was not begun, and it is not carried out later."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._lock = threading.Lock()
        self._waiting: deque[_Pending] = deque()
        self._present: _Pending | None = None
        self.dropped = 0
        """Number of requests that came while too many were waiting."""

    def submit(self, request: RemoteRequest) -> None:
        """Add a request, or refuse it if too many are waiting. Called by any thread."""
        with self._lock:
            has_room = len(self._waiting) < self._size
            if has_room:
                self._waiting.append(_Pending(request))
            else:
                self.dropped += 1
        if not has_room:
            request.refuse(BUSY)

    def take(self) -> RemoteRequest | None:
        """Return the oldest request, which is the present one until the next call; None: none is waiting."""
        with self._lock:
            self._present = self._waiting.popleft() if self._waiting else None
            return None if self._present is None else self._present.guarded()

    def refuse(self, why: str) -> None:
        """Refuse what was not begun. A copy of the request that was begun waits for its answer. Called by any thread."""
        with self._lock:
            begun = self._present if self._present is not None and self._present.is_begun else None
            copies = [] if begun is None else [each for each in self._waiting if each.id == begun.id]
            others = [each for each in self._waiting if each not in copies]
            self._waiting = deque(copies)
            present = self._present
        for each in others if present is None else [present, *others]:
            each.refuse(why)


class _Pending:
    """A request that is either begun or refused, whichever happens first."""

    def __init__(self, request: RemoteRequest) -> None:
        self._request = request
        self._lock = threading.Lock()
        self.is_begun = False
        self._is_refused = False
        self.id: str | None = getattr(request.content, "id", None)

    def guarded(self) -> RemoteRequest:
        """Return the request for its handler."""
        return replace(self._request, reply=self._reply, begin=self._begin)

    def refuse(self, why: str) -> None:
        """Refuse the request once, unless it was begun."""
        with self._lock:
            if self.is_begun or self._is_refused:
                return
            self._is_refused = True
        self._request.refuse(why)

    def _begin(self) -> None:
        with self._lock:
            if self._is_refused:
                raise TimeoutError(HANGS)
            self.is_begun = True

    def _reply(self, accepted: bool, content: Mapping[str, Any]) -> None:
        with suppress(TimeoutError):
            self._begin()
            self._request.reply(accepted, content)
