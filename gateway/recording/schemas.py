"""JSON Schemas in the form that MCAP viewers can read.

Lichtblick and older Foxglove ignore a topic whose schema has a `$ref` or a property without a single `type`, which is how "a
number or null" is written. Here references are replaced by their content, and properties that may be null move from
`properties` into `allOf`, which these viewers ignore: every topic loads, every value can be plotted by its path, and the schema
remains correct.
"""

import json
from functools import cache
from typing import Any

from gateway.topics import TOPICS, json_schema

Schema = dict[str, Any]
VIEWER_TYPES = frozenset({"boolean", "string", "number", "integer", "object", "array"})


@cache
def schema_bytes(topic: str) -> bytes:
    """Return the schema of a topic for a recording."""
    schema = json_schema(topic)
    definitions = schema.pop("$defs", {})
    return json.dumps(_make_viewable(_resolve_references(schema, definitions)), separators=(",", ":")).encode()


def logged_topics() -> list[str]:
    """Return the names of the topics that a recording contains."""
    return [topic.name for topic in TOPICS.values() if topic.logged]


def _resolve_references(node: Any, definitions: dict[str, Schema]) -> Any:
    """Return the schema with each `$ref` replaced by its content."""
    if isinstance(node, list):
        return [_resolve_references(entry, definitions) for entry in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        name = node["$ref"].removeprefix("#/$defs/")
        others = {key: value for key, value in node.items() if key != "$ref"}
        return _resolve_references({**definitions[name], **others}, definitions)
    return {key: _resolve_references(value, definitions) for key, value in node.items()}


def _make_viewable(schema: Schema) -> Schema:
    """Return the schema of an object with everything that a viewer cannot read moved into `allOf`."""
    properties = {name: _make_property_viewable(entry) for name, entry in schema.get("properties", {}).items()}
    plain = {name: entry for name, entry in properties.items() if _has_single_type(entry)}
    others = {name: entry for name, entry in properties.items() if name not in plain}
    return {**schema, "properties": plain, **({"allOf": [{"properties": others}]} if others else {})}


def _make_property_viewable(schema: Schema) -> Schema:
    match schema.get("type"):
        case "object":
            return _make_viewable(schema)
        case "array" if schema["items"].get("type") == "object":
            return {**schema, "items": _make_viewable(schema["items"])}
        case _:
            return schema


def _has_single_type(schema: Schema) -> bool:
    if schema.get("type") == "array":
        return schema["items"].get("type") in VIEWER_TYPES - {"array"}
    return schema.get("type") in VIEWER_TYPES
