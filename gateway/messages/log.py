"""A line of the log in the schema of Foxglove, and a mark that a person sets in the recording."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from gateway.messages.header import Message


@dataclass(frozen=True, slots=True, kw_only=True)
class FoxgloveTime:
    """The time of a `foxglove.Log`."""

    sec: int
    nsec: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A line of the log, in the schema `foxglove.Log`."""

    timestamp: FoxgloveTime
    level: Annotated[int, Field(description="1 debug, 2 info, 3 warning, 4 error, 5 fatal")]
    message: str
    name: str
    file: str = ""
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark(Message):
    """A mark that a person set in the recording; the time around it is kept like that around an alert."""

    id: Annotated[str, Field(description="id of the request")]
    by: Annotated[str, Field(description="who set it, as stated in the request")]
    text: str
