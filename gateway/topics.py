"""The table of topics. Recordings, the bus, the page and the documentation follow from it."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec
import numpy as np
from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from gateway import messages


@dataclass(frozen=True, slots=True)
class Topic:
    """One row: name, type of the messages, their rate, and their sinks."""

    name: str
    type: type[Any]
    rate: str
    logged: bool
    published: bool
    schema_name: str

    @property
    def path(self) -> str:
        """The topic's name in a recording."""
        return f"/{self.name}"


TOPICS: dict[str, Topic] = {
    name: Topic(name, type_, rate, logged, published, schema_name)
    for name, type_, rate, logged, published, schema_name in (
        ("samples", messages.Samples, "each block", True, True, "plumbline.Samples"),
        ("acceleration", messages.Acceleration, "5 Hz", True, False, "plumbline.Acceleration"),
        ("tilt", messages.Tilt, "10 Hz", True, True, "plumbline.Tilt"),
        ("motion", messages.Motion, "10 Hz", True, True, "plumbline.Motion"),
        ("swing", messages.Swing, "three times a swing, or 1 Hz", True, True, "plumbline.Swing"),
        ("condition", messages.Condition, "2 Hz and at each change", True, True, "plumbline.Condition"),
        ("alert", messages.Alert, "1 Hz and at each change", True, True, "plumbline.Alert"),
        ("health", messages.Health, "1 Hz", True, True, "plumbline.Health"),
        (
            "calibration",
            messages.Calibration,
            "0.1 Hz, 2 Hz in a session, at each change, first in each segment",
            True,
            True,
            "plumbline.Calibration",
        ),
        ("mark", messages.Mark, "as set", True, True, "plumbline.Mark"),
        ("clock", messages.ClockOffset, "1 Hz", True, False, "plumbline.Clock"),
        ("log", messages.Log, "as written", True, False, "foxglove.Log"),
    )
}
"""The topics by name, in the order of the table in `docs/architecture.md`, which a test compares with this one."""

TOPIC_OF: dict[type[Any], Topic] = {topic.type: topic for topic in TOPICS.values()}


@cache
def adapter(topic: str) -> TypeAdapter[Any]:
    """Return the serialiser and validator of a topic's messages."""
    return TypeAdapter(TOPICS[topic].type)


class _EveryFieldRequired(GenerateJsonSchema):
    """The schema of messages on the bus, which have every field: a number that is not known is null."""

    def field_is_required(self, *_: Any, **__: Any) -> bool:
        return True


def json_schema(topic: str) -> dict[str, Any]:
    """Return the JSON Schema of a topic's messages on the bus."""
    schema = adapter(topic).json_schema(mode="serialization", schema_generator=_EveryFieldRequired)
    schema["title"] = TOPICS[topic].schema_name
    return schema


def encode(message: object) -> bytes:
    """Encode a message as JSON; a number that is not finite becomes null."""
    return _ENCODER.encode(message)


def _plain_value(value: object) -> object:
    """Return a NumPy scalar as a number of Python."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a message cannot contain a {type(value).__name__}")


_ENCODER = msgspec.json.Encoder(enc_hook=_plain_value)
"""Pydantic, which validates what is read, takes three times as long to write a block of samples."""
