"""Answers to requests, kept by id: a client repeats a request whose answer was lost, and it must not be executed twice."""

from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ConfigDict


class RequestAnswer(BaseModel):
    """The answer to a request, kept so that the same request has the same answer."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    request: str
    """Verb and content of the request, which distinguish it from another request with the same id."""
    accepted: bool
    text: str
    content: dict[str, Any] = {}

    def payload(self) -> dict[str, Any]:
        """Return the content of the reply."""
        text = {"text": self.text} if self.accepted else {"reason": self.text}
        return {"id": self.id, "accepted": self.accepted, **text, **self.content}


class AnsweredRequests:
    """The last answers; an answer is kept until so many others have come after it."""

    def __init__(self, capacity: int, answers: Iterable[RequestAnswer] = ()) -> None:
        self._capacity = capacity
        self._answers = {answer.id: answer for answer in answers}

    def get(self, request_id: str) -> RequestAnswer | None:
        """Return the answer that was given to a request; None where there was none, or where it is forgotten."""
        return self._answers.get(request_id)

    def add(self, answer: RequestAnswer) -> RequestAnswer:
        """Keep an answer, and return it."""
        self._answers[answer.id] = answer
        while len(self._answers) > self._capacity:
            del self._answers[next(iter(self._answers))]
        return answer

    def all(self) -> tuple[RequestAnswer, ...]:
        """Return the answers, oldest first."""
        return tuple(self._answers.values())
