"""Requests that were admitted, on their way to the thread that carries them out; each is answered once."""

import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from pydantic import BaseModel

from gateway.authorization.caller import Caller
from gateway.recalibration.requests import RequestAnswer

Model = TypeVar("Model", bound=BaseModel)
Reply = Callable[[bool, Mapping[str, Any]], object]
"""Sends an answer: whether the request was accepted, and the content. It may be called by any thread, once."""
BUSY = "busy: too many requests are waiting"
HANGS = "the disk does not answer"


def _begin_at_once() -> None:
    """Begin a request that nobody else may refuse."""


@dataclass(frozen=True, slots=True)
class RemoteRequest:
    """A request of the verb's model; `by` in it is the authenticated name."""

    verb: str
    content: BaseModel
    caller: Caller | None
    """None for a verb that needs no role."""
    reply: Reply
    begin: Callable[[], None] = _begin_at_once
    """Called before anything is changed; raises `TimeoutError` where the request was refused meanwhile."""

    def expect(self, model: type[Model]) -> Model:
        """Return the content. Raises `TypeError` where the table of verbs names another model than the handler."""
        if not isinstance(self.content, model):
            raise TypeError(f"rpc/{self.verb}: a {type(self.content).__name__} is no {model.__name__}")
        return self.content

    def refuse(self, why: str) -> None:
        """Send a refusal."""
        self.reply(False, {"id": getattr(self.content, "id", ""), "accepted": False, "reason": why})

    def answer(self, answer: RequestAnswer) -> None:
        """Send the answer."""
        self.reply(answer.accepted, answer.payload())


RequestHandler = Callable[[RemoteRequest], None]
"""Answers the requests of one verb, now or later."""


class RequestQueue:
    """At most `size` requests, and the present one. What `refuse` has answered before it was begun is not carried out."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._lock = threading.Lock()
        self._waiting: deque[RemoteRequest] = deque()
        self._present: RemoteRequest | None = None
        self._is_begun = False
        self.dropped = 0
        """Number of requests that came while too many were waiting."""

    def submit(self, request: RemoteRequest) -> None:
        """Add a request, or refuse it if too many are waiting. Called by any thread."""
        with self._lock:
            has_room = len(self._waiting) < self._size
            if has_room:
                self._waiting.append(request)
            else:
                self.dropped += 1
        if not has_room:
            request.refuse(BUSY)

    def take(self) -> RemoteRequest | None:
        """Return the oldest request, which is the present one until the next call; None: none is waiting."""
        with self._lock:
            self._present, self._is_begun = self._waiting.popleft() if self._waiting else None, False
            request = self._present
        if request is None:
            return None
        return replace(request, begin=partial(self._begin, request), reply=partial(self._reply, request))

    def refuse(self, why: str) -> None:
        """Refuse what was not begun. A copy of the request that was begun waits for its answer. Called by any thread."""
        with self._lock:
            refused = list(self._waiting)
            if self._present is not None and self._is_begun:
                begun = _id_of(self._present)
                refused = [each for each in refused if _id_of(each) != begun]
                self._waiting = deque(each for each in self._waiting if _id_of(each) == begun)
            else:
                self._waiting.clear()
                if self._present is not None:
                    refused.insert(0, self._present)
                    self._present = None
        for each in refused:
            each.refuse(why)

    def _begin(self, request: RemoteRequest) -> None:
        with self._lock:
            if self._present is not request:
                raise TimeoutError(HANGS)
            self._is_begun = True

    def _reply(self, request: RemoteRequest, accepted: bool, content: Mapping[str, Any]) -> None:
        with suppress(TimeoutError):
            self._begin(request)
            request.reply(accepted, content)


def _id_of(request: RemoteRequest) -> str:
    return str(getattr(request.content, "id", ""))
