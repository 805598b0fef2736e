"""A line of the log in the schema of Foxglove."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field


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
