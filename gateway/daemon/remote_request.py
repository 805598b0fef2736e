"""A request that was admitted, on its way to the handler of its verb."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel

from gateway.authorization.caller import Caller
from gateway.recalibration.request_answers import RequestAnswer

Model = TypeVar("Model", bound=BaseModel)
Reply = Callable[[bool, Mapping[str, Any]], object]
"""Sends an answer: whether the request was accepted, and the content. It may be called by any thread, once."""


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
