"""The journal and the audit of recalibration.

The journal is the session and the given answers, from which a restart continues: one file, replaced at each change. The audit
has a line for every authorised request and its outcome, on the disk before the request is executed.
"""

import json
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from gateway.atomic_io import append_line, write_durably
from gateway.errors import describe_problems
from gateway.file_input import parse_json, read_bounded
from gateway.recalibration.requests import AnsweredRequests, RequestAnswer
from gateway.recalibration.session import Session

MAX_ANSWERS = 64
"""Number of answers that are kept. Basis: a choice; a request is repeated after seconds, and the file stays small."""
MAX_AUDIT_BYTES = 8_000_000
"""Size at which the file becomes the previous file; there is one previous file. Basis: a choice; years of changes, and two files
are nothing to a card."""


class JournalContent(BaseModel):
    """Content of `session.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    session: Session | None
    answers: tuple[RequestAnswer, ...]


class Journal:
    """`<data_dir>/calibration/session.json`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._session: Session | None = None
        self._answers, self._refusals = AnsweredRequests(MAX_ANSWERS), AnsweredRequests(MAX_ANSWERS)
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
        answers = AnsweredRequests(MAX_ANSWERS, self._answers.all())
        if answer is not None:
            answers.add(answer)
        content = JournalContent(session=session, answers=answers.all())
        write_durably(self._path, content.model_dump_json(indent=1).encode())
        self._session, self._answers = session, answers

    def remember(self, answer: RequestAnswer) -> None:
        """Keep the answer to a refused request in memory: it has changed nothing, and displaces no answer that is on the disk."""
        self._refusals.add(answer)

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
        self._answers = AnsweredRequests(MAX_ANSWERS, content.answers)


class Audit:
    """`<data_dir>/calibration/audit.jsonl`; every entry is also logged, and so recorded."""

    def __init__(self, path: Path, log_line: Callable[[str], None]) -> None:
        self._path = path
        self._log_line = log_line

    def write(self, time_utc: str, event: str, *, durable: bool = True, **content: Any) -> None:
        """Append an entry, and wait for the disk where it is to be durable. Raises `OSError`."""
        line = json.dumps({"time_utc": time_utc, "event": event, **content})
        self._log_line(f"audit {line}")
        append_line(self._path, line.encode(), durable=durable, max_bytes=MAX_AUDIT_BYTES)

    def newest(self, count: int) -> list[dict[str, Any]]:
        """Return the last entries of the file, oldest first, without a line that a kill has truncated. Raises `OSError`."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            lines = deque(file, maxlen=count)
        return [entry for entry in map(_parse_entry, lines) if entry is not None]


def _parse_entry(line: bytes) -> dict[str, Any] | None:
    try:
        entry = parse_json(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None
