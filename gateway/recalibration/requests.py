"""What may be asked of a gateway, checked before anything looks at it."""

from typing import Annotated, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gateway.calibration.store import ID_PATTERN
from gateway.errors import InputError, describe_problems

LARGEST_PAYLOAD = 8192
Model = TypeVar("Model", bound=BaseModel)
RequestId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{7,63}$")]
Line = r"^[^\x00-\x1f\x7f\u2028\u2029]*$"
"""One line: nothing that would forge a second one in a log."""
RecordId = Annotated[str, Field(pattern=ID_PATTERN)]
MethodName = Literal["six-position", "norm-fit"]


class RequestError(InputError):
    """A payload is no request; the text says where and why."""


class Request(BaseModel):
    """What every request that changes something carries."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: RequestId
    """Chosen by whoever asks: the same id is the same request, however often it comes."""
    by: str = Field(min_length=1, max_length=80, pattern=Line)
    """Who asks, as said: nobody is authenticated."""
    reason: str = Field("", max_length=500, pattern=Line)


class Recalibrate(Request):
    """Begin a session."""

    method: MethodName = "six-position"
    housing_off_rope: bool = False
    """Confirmed: the housing has been taken off the rope."""


class Zero(Request):
    """Make the mount's two angles zero where the load hangs still."""


class Commit(Request):
    """Put the reviewed record in force."""

    record: RecordId | None = None
    """The record that was reviewed; another one is not put in force."""


class Rollback(Request):
    """Put the parent, or a named record, in force again."""

    to: RecordId | None = None


class Cancel(Request):
    """End the session."""


class Fetch(BaseModel):
    """Read what is stored; nothing is changed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    what: Literal["records", "record", "audit"] = "records"
    record: RecordId | None = None
    lines: int = Field(100, ge=1, le=1000)
    """Of the audit, the newest."""

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.what == "record" and self.record is None:
            raise ValueError("record: say which one")
        return self


VERBS: dict[str, type[Request]] = {
    "recalibrate": Recalibrate,
    "zero": Zero,
    "commit": Commit,
    "rollback": Rollback,
    "cancel": Cancel,
}
"""What changes something."""


def parse_request(verb: str, payload: bytes) -> Request:
    """The request of a payload. Raises `RequestError`."""
    return _parsed(VERBS[verb], payload)


def parse_fetch(payload: bytes) -> Fetch:
    """What is to be read; an empty payload asks for the list of records. Raises `RequestError`."""
    return _parsed(Fetch, payload or b"{}")


def _parsed(model: type[Model], payload: bytes) -> Model:
    if len(payload) > LARGEST_PAYLOAD:
        raise RequestError(f"a request of {len(payload)} bytes; {LARGEST_PAYLOAD} is the most")
    try:
        return model.model_validate_json(payload)
    except ValidationError as error:
        raise RequestError(describe_problems(error, "request")[0]) from error
