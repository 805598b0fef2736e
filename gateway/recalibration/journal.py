"""The journal: the session and the given answers, from which a restart continues; one file, replaced at each change."""

from collections import OrderedDict
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from gateway.atomic_io import write_durably
from gateway.disk_job import PerformJob, perform_now
from gateway.errors import describe_problems
from gateway.file_input import parse_json, read_bounded
from gateway.recalibration.session import Session

MAX_ANSWERS = 64
"""Number of answers that are kept."""


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


class JournalContent(BaseModel):
    """Content of `session.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    session: Session | None
    answers: tuple[RequestAnswer, ...]


class Journal:
    """`<data_dir>/calibration/session.json`."""

    def __init__(self, path: Path, perform: PerformJob = perform_now) -> None:
        """`perform` carries out what is to be written."""
        self._path = path
        self._perform = perform
        self._session: Session | None = None
        self._answers: OrderedDict[str, RequestAnswer] = OrderedDict()
        self._refusals: OrderedDict[str, RequestAnswer] = OrderedDict()
        self.read_error: str | None = None
        """Why the file could not be read; None: it was read, or there was none."""
        self._read()

    @property
    def session(self) -> Session | None:
        """The last session that is on the disk."""
        return self._session

    def answer(self, request_id: str) -> RequestAnswer | None:
        """Return the answer that was given to a request."""
        return self._answers.get(request_id) or self._refusals.get(request_id)

    def save(self, session: Session | None, answer: RequestAnswer | None = None) -> None:
        """Save a session, and an answer. Raises `OSError`, and the file on the disk is unchanged then."""
        answers = OrderedDict(self._answers)
        if answer is not None:
            _add(answer, answers)
        content = JournalContent(session=session, answers=tuple(answers.values()))
        text = content.model_dump_json(indent=1).encode()
        self._perform(lambda is_wanted: write_durably(self._path, text, is_wanted))
        self._session, self._answers = session, answers

    def remember(self, answer: RequestAnswer) -> None:
        """Keep the answer to a refused request in memory: it has changed nothing, and displaces no answer that is on the disk."""
        _add(answer, self._refusals)

    def _read(self) -> None:
        try:
            content = JournalContent.model_validate(parse_json(read_bounded(self._path)))
        except FileNotFoundError:
            return
        except ValidationError as error:
            self.read_error = f"{self._path}: {describe_problems(error)[0]}; a session that was active has ended"
            return
        except (OSError, ValueError) as error:
            self.read_error = f"{self._path}: cannot be read ({error}); a session that was active has ended"
            return
        self._session = content.session
        self._answers = OrderedDict((answer.id, answer) for answer in content.answers)


def _add(answer: RequestAnswer, answers: OrderedDict[str, RequestAnswer]) -> None:
    """Add an answer, and forget the oldest beyond `MAX_ANSWERS`."""
    answers[answer.id] = answer
    while len(answers) > MAX_ANSWERS:
        answers.popitem(last=False)
