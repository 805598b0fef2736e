"""A mark that a person sets in the recording."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from gateway.messages.header import Message


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark(Message):
    """A mark that a person set in the recording; the time around it is kept like that around an alert."""

    id: Annotated[str, Field(description="id of the request")]
    by: Annotated[str, Field(description="who set it, as stated in the request")]
    text: str
