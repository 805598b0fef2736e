"""What a restart goes on from: the session and the answers that were given, replaced as one file at each change."""

import json
from collections import OrderedDict
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from gateway.atomic_io import write_durably
from gateway.errors import describe_problems
from gateway.recalibration.session import Session

MOST_ANSWERS = 64


class Answer(BaseModel):
    """The answer to a request, kept so that the same request has the same answer."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    request: str
    """Verb and content, by which another request with this id is known."""
    accepted: bool
    text: str
    content: dict[str, Any] = {}

    def payload(self) -> dict[str, Any]:
        """As it is sent."""
        said = {"text": self.text} if self.accepted else {"reason": self.text}
        return {"id": self.id, "accepted": self.accepted, **said, **self.content}


class _Content(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    session: Session | None
    answers: tuple[Answer, ...]


class Journal:
    """`<data_dir>/calibration/session.json`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._session: Session | None = None
        self._answers: OrderedDict[str, Answer] = OrderedDict()
        self.complaint: str | None = None
        """What was wrong with the file that was found."""
        self._load()

    @property
    def session(self) -> Session | None:
        """The last session, as it is on the disk."""
        return self._session

    def answer(self, request_id: str) -> Answer | None:
        """The answer that was given to a request."""
        return self._answers.get(request_id)

    def save(self, session: Session | None, answer: Answer | None = None) -> None:
        """Keep a session as it stands now, and an answer. Raises `OSError`; then the disk has what it had."""
        answers = OrderedDict(self._answers)
        if answer is not None:
            answers[answer.id] = answer
            while len(answers) > MOST_ANSWERS:
                answers.popitem(last=False)
        content = _Content(session=session, answers=tuple(answers.values()))
        write_durably(self._path, content.model_dump_json(indent=1).encode())
        self._session, self._answers = session, answers

    def _load(self) -> None:
        try:
            content = _Content.model_validate(json.loads(self._path.read_bytes()))
        except FileNotFoundError:
            return
        except ValidationError as error:
            self.complaint = f"{self._path}: {describe_problems(error)[0]}; a session that was under way has ended"
            return
        except (OSError, ValueError) as error:
            self.complaint = f"{self._path}: cannot be read ({error}); a session that was under way has ended"
            return
        self._session = content.session
        self._answers = OrderedDict((answer.id, answer) for answer in content.answers)
