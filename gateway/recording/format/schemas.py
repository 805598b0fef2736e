"""JSON Schemas in the form that MCAP viewers can read.

Lichtblick and older Foxglove ignore a topic whose schema has a `$ref`, and offer no field without a single `type`, which is how
"a number or null" is written. Recorded messages leave out what is null (`gateway.recording.format.encoding`). Here references are
replaced by their content, and a field that may be left out has the type of its values and is not required: every number can be
plotted.
"""

import json
from functools import cache
from typing import Any

from gateway.topics import TOPICS, adapter

Schema = dict[str, Any]
NULL = {"type": "null"}


@cache
def schema_bytes(topic: str) -> bytes:
    """Return the schema of a topic for a recording."""
    schema = adapter(topic).json_schema(mode="serialization")
    definitions = schema.pop("$defs", {})
    viewable = {"title": TOPICS[topic].schema_name, **_make_viewable(schema, definitions)}
    return json.dumps(viewable, separators=(",", ":")).encode()


def logged_topics() -> list[str]:
    """Return the names of the topics that a recording contains."""
    return [topic.name for topic in TOPICS.values() if topic.logged]


def _make_viewable(schema: Schema, definitions: dict[str, Schema]) -> Schema:
    """Return the schema without references, without the alternative null, and without titles, which repeat the names."""
    schema = {key: value for key, value in schema.items() if key != "title" or isinstance(value, dict)}
    if "$ref" in schema:
        name = schema["$ref"].removeprefix("#/$defs/")
        others = {key: value for key, value in schema.items() if key != "$ref"}
        return _make_viewable({**definitions[name], **others}, definitions)
    if NULL in schema.get("anyOf", ()):
        (known,) = (option for option in schema["anyOf"] if option != NULL)
        others = {key: value for key, value in schema.items() if key not in ("anyOf", "default")}
        return _make_viewable({**known, **others}, definitions)
    if schema.get("type") == "array":
        return {**schema, "items": _make_viewable(schema["items"], definitions)}
    if schema.get("type") == "object":
        fields = schema.get("properties", {})
        return {**schema, "properties": {name: _make_viewable(entry, definitions) for name, entry in fields.items()}}
    return schema
