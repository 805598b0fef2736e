"""JSON Schemas in the form that MCAP viewers read.

Lichtblick and older Foxglove drop a whole topic whose schema holds a `$ref` or a property without one plain `type`, which is
how "a number or null" is written. Here references are put in place, and properties that may be null move from `properties` into
`allOf`, which these viewers pass over: every topic loads, every value can be plotted by its path, and the schema stays true.
"""

import json
from functools import cache
from typing import Any

from gateway.topics import TOPICS, json_schema

Schema = dict[str, Any]
VIEWER_TYPES = frozenset({"boolean", "string", "number", "integer", "object", "array"})


@cache
def schema_bytes(topic: str) -> bytes:
    """The schema that a recording carries for a topic."""
    schema = json_schema(topic)
    definitions = schema.pop("$defs", {})
    return json.dumps(_viewable(_resolved(schema, definitions)), separators=(",", ":")).encode()


def logged_topics() -> list[str]:
    """Names of the topics that a recording holds."""
    return [topic.name for topic in TOPICS.values() if topic.logged]


def _resolved(node: Any, definitions: dict[str, Schema]) -> Any:
    """The same schema with each `$ref` replaced by what it refers to."""
    if isinstance(node, list):
        return [_resolved(entry, definitions) for entry in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        name = node["$ref"].removeprefix("#/$defs/")
        others = {key: value for key, value in node.items() if key != "$ref"}
        return _resolved({**definitions[name], **others}, definitions)
    return {key: _resolved(value, definitions) for key, value in node.items()}


def _viewable(schema: Schema) -> Schema:
    """An object's schema with what a viewer cannot read moved into `allOf`."""
    properties = {name: _viewable_property(entry) for name, entry in schema.get("properties", {}).items()}
    plain = {name: entry for name, entry in properties.items() if _has_one_type(entry)}
    others = {name: entry for name, entry in properties.items() if name not in plain}
    return {**schema, "properties": plain, **({"allOf": [{"properties": others}]} if others else {})}


def _viewable_property(schema: Schema) -> Schema:
    match schema.get("type"):
        case "object":
            return _viewable(schema)
        case "array" if schema["items"].get("type") == "object":
            return {**schema, "items": _viewable(schema["items"])}
        case _:
            return schema


def _has_one_type(schema: Schema) -> bool:
    if schema.get("type") == "array":
        return schema["items"].get("type") in VIEWER_TYPES - {"array"}
    return schema.get("type") in VIEWER_TYPES
