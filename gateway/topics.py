"""The table of topics. Recordings, the bus, the page and the documentation follow from it."""

from collections.abc import Callable
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
    """One row: name, type of the messages, their rate, and what becomes of them."""

    name: str
    type: type[Any]
    rate: str
    logged: bool = True
    published: bool = True
    recomputed: bool = False
    """The pipeline computes it from the samples, and so does a replay; others are of the gateway and its host."""
    sent_idle: bool = False
    """Also sent while no samples come."""
    repeated: bool = False
    """Repeated at the start of each segment, so that a segment can be read without the one before."""
    recorded_every: int = 1
    """One message in so many is recorded: the low-pass of the tilt leaves nothing that is faster than 2 Hz."""
    summarised: bool = True
    """The summary of a segment depends on its messages, beyond their number."""
    always_kept: bool = False
    """Kept where the quota leaves only the time around events."""
    is_state: bool = False
    """The state of a gateway: the router keeps the last message for those who join late, and a fleet receives it. Tilt, motion
    and samples would be nine tenths of the traffic."""
    signed: bool = True
    """Signed on the bus with the gateway's key. Blocks of samples are not: up to a hundred a second, and nobody is shown them."""
    schema_owner: str = "plumbline"

    @property
    def path(self) -> str:
        """The topic's name in a recording."""
        return f"/{self.name}"

    @property
    def schema_name(self) -> str:
        """The name of the messages' schema."""
        return f"{self.schema_owner}.{self.name.capitalize()}"


TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        Topic("samples", messages.Samples, "each block", recomputed=True, signed=False),
        Topic("acceleration", messages.Acceleration, "5 Hz", published=False, recomputed=True, summarised=False),
        Topic("tilt", messages.Tilt, "10 Hz", recomputed=True, recorded_every=5, summarised=False),
        Topic("motion", messages.Motion, "10 Hz", recomputed=True, sent_idle=True),
        Topic("swing", messages.Swing, "three times a swing, or 1 Hz", recomputed=True, is_state=True),
        Topic(
            "condition", messages.Condition, "2 Hz and at each change", recomputed=True, sent_idle=True, is_state=True
        ),
        Topic("alert", messages.Alert, "1 Hz and at each change", recomputed=True, sent_idle=True, is_state=True),
        Topic("health", messages.Health, "1 Hz", is_state=True),
        Topic(
            "calibration",
            messages.Calibration,
            "0.1 Hz, 2 Hz in a session, at each change, first in each segment",
            recomputed=True,
            repeated=True,
            always_kept=True,
            is_state=True,
        ),
        Topic("mark", messages.Mark, "as set", always_kept=True),
        Topic("clock", messages.ClockOffset, "1 Hz", published=False, repeated=True, always_kept=True),
        Topic("log", messages.Log, "as written", published=False, schema_owner="foxglove"),
    )
}
"""The topics by name, in the order of the table in `docs/reference/messages.md`, which a test compares with this one. Of
the tilt one message in five is recorded. Basis: its low-pass leaves nothing that is faster than 2 Hz."""

KEY_PREFIX = "plumbline/v1/"
"""Begin of every key on the bus, with the version of the keys; site, crane and sensor follow, then the topic."""
DEMO_SITE = "demo-site"
"""The site of a gateway that nobody has named: many have it."""
ANY_GATEWAY = f"{KEY_PREFIX}*/*/*"
EVERY_KEY = f"{KEY_PREFIX}**"
ALIVE = "alive"
"""Below a gateway's key: the token of its liveliness."""
STATE_TOPICS = tuple(topic.name for topic in TOPICS.values() if topic.is_state)
UNSIGNED_TOPICS = tuple(topic.name for topic in TOPICS.values() if not topic.signed)
TOPIC_OF: dict[type[Any], Topic] = {topic.type: topic for topic in TOPICS.values()}


def paths_with(flag: Callable[[Topic], object]) -> frozenset[str]:
    """Return the names in a recording of the topics of which something holds."""
    return frozenset(topic.path for topic in TOPICS.values() if flag(topic))


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
