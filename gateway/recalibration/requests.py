"""Requests and signals to a gateway, their validation before anything uses them, and their answers.

Answers are kept by id: a client repeats a request whose answer was lost, and it must not be executed twice.
"""

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StrictBool, ValidationError, model_validator

from gateway.calibration.record import PoseMethod
from gateway.calibration.store import ID_PATTERN
from gateway.errors import InputError, describe_problems, pattern_of

MAX_PAYLOAD_BYTES = 8192
"""Largest request. Basis: a choice; a credential may have as much, and a configuration has its own limit."""
ONE_LINE_PATTERN = pattern_of(
    r"^[^\x00-\x1f\x7f\u2028\u2029]*$", "one line, without breaks and other control characters"
)
"""Pattern of a text that cannot forge a second line in a log."""
Model = TypeVar("Model", bound=BaseModel)
ID_OF_REQUEST = pattern_of(
    r"^[A-Za-z0-9][A-Za-z0-9._-]{7,63}$", "an id of 8 to 64 letters, digits, dots, underscores and hyphens"
)
RequestId = Annotated[str, Field(pattern=ID_OF_REQUEST)]
RecordId = Annotated[str, Field(pattern=ID_PATTERN)]


class RequestError(InputError):
    """A payload is no valid request; the text states the place and the reason."""


class Request(BaseModel):
    """The fields of every request that changes something."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: RequestId
    """Id chosen by the client: the same id is the same request, however often it arrives."""
    by: str = Field(min_length=1, max_length=80, pattern=ONE_LINE_PATTERN)
    """Person who makes the request: the gateway replaces a stated name by the authenticated one."""
    reason: str = Field("", max_length=500, pattern=ONE_LINE_PATTERN)


class Recalibrate(Request):
    """Start a session."""

    method: PoseMethod = PoseMethod.SIX_POSITION
    housing_off_rope: StrictBool = False
    """Confirmation that the housing has been taken off the rope."""


class SetMark(Request):
    """Write a mark into the recording."""

    text: str = Field(min_length=1, max_length=500, pattern=ONE_LINE_PATTERN)


class Acknowledge(Request):
    """Acknowledge an incident; without one all that nobody has acknowledged. What was raised after the challenge is not meant."""

    incident: str | None = Field(None, pattern=r"^[A-Za-z0-9-]{1,64}$")


class Zero(Request):
    """Remove the mount's two angles while the load hangs still."""


class Commit(Request):
    """Put the reviewed record in force."""

    record: RecordId | None = None
    """Id of the reviewed record; another record is not put in force."""


class Rollback(Request):
    """Put the parent, or a named record, in force again."""

    to: RecordId | None = None


class Cancel(Request):
    """End the session."""


class NoContent(BaseModel):
    """A request whose verb says everything; what a client sends beside it is ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Fetch(BaseModel):
    """Read what is stored, without changing it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    what: Literal["records", "record", "audit"] = "records"
    record: RecordId | None = None
    lines: int = Field(100, ge=1, le=1000)
    """Number of entries of the audit, the newest."""

    @model_validator(mode="after")
    def _require_record(self) -> Self:
        if self.what == "record" and self.record is None:
            raise ValueError("record: name the record")
        return self


class LoadSignal(BaseModel):
    """The message that a load cell or the crane's controller puts on `<gateway>/load`."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    loaded: bool


class FetchSchema(BaseModel):
    """Read the JSON Schema of a topic; without one the list of topics and verbs."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    topic: str | None = Field(None, max_length=64)


class FetchAlerts(BaseModel):
    """Read the changes of alerts behind the last one that the caller has, page by page."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    after: int = Field(0, ge=0)
    """Number of that change; 0: none."""
    boot: str | None = Field(None, pattern=r"^[A-Za-z0-9]{1,64}$")
    """Boot id of that change; without it the number alone counts."""


class ReadConfiguration(Request):
    """Read the configuration, without secrets, files and commands."""


class ProposeConfiguration(Request):
    """Check a change of the configuration, and keep it for `ApplyConfiguration`."""

    proposal: dict[str, dict[str, Any]]
    """Sections that take the place of those of the file, as far as they may be changed over the bus."""
    allow_network: bool = False
    """Permission to change keys by which the gateway is reached."""
    keep: bool = True
    """False: only check it."""


class ApplyConfiguration(Request):
    """Put a proposal into force, on trial."""

    proposal: RequestId
    """Id of the request that proposed it."""


VERBS: dict[str, type[Request]] = {
    "recalibrate": Recalibrate,
    "zero": Zero,
    "commit": Commit,
    "rollback": Rollback,
    "cancel": Cancel,
}
"""Verbs of the requests that change something, with their contents."""


def parse_payload(model: type[Model], payload: bytes) -> Model:
    """Return the request in a payload; an empty payload is one without fields. Raises `RequestError`."""
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise RequestError(f"the request has {len(payload)} bytes; at most {MAX_PAYLOAD_BYTES} are allowed")
    try:
        return model.model_validate_json(payload or b"{}")
    except ValidationError as error:
        raise RequestError(describe_problems(error, "request")[0]) from error


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
