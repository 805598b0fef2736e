"""What viewers find in a recording, by the rules of their own readers.

Lichtblick and Foxglove: `parseJsonSchema` in packages/mcap-support/src/parseJsonSchema.ts of Lichtblick (2023 to 2025, from
Foxglove Studio); a topic is given up where it throws. Message paths: packages/message-path/src/grammar.ne. User scripts:
`getOutputTopic` in UserScriptPlayer/transformerWorker/transform.ts. PlotJuggler 3: `NlohmannParser::parseMessageImpl` in
plotjuggler_app/nlohmann_parsers.cpp, and `GetSnippetFromXML` in plotjuggler_app/transforms/custom_function.cpp.
"""

import json
import re
from collections.abc import Iterator
from typing import Any

PLAIN = {"boolean": "bool", "string": "string", "number": "float64", "integer": "float64"}
SCRIPT_TOPICS = "/studio_script/"
PATH = re.compile(r"(?P<topic>/[\w/]+)(?P<steps>(?:\.\w+(?:\[(?:\d+|:)\])?(?:\{[^}]*\})?)+)$")
STEP = re.compile(
    r"\.(?P<name>\w+)(?P<slice>\[(?:\d+|:)\])?(?P<filter>\{(?P<key>\w+)==(?:\"[^\"]*\"|\d+|true|false)\})?"
)


def lichtblick_fields(schema: dict[str, Any], place: str = "") -> dict[str, str]:
    """The paths of all fields of a schema with their types; an array ends in []. Raises `ValueError` where the viewer does."""
    if schema.get("type") != "object":
        raise ValueError(f"{place}: an object is expected, not {schema.get('type')}")
    found: dict[str, str] = {}
    for name, field in schema.get("properties", {}).items():
        is_array = field.get("type") == "array"
        entry, path = (field["items"], f"{place}.{name}[]") if is_array else (field, f"{place}.{name}")
        kind = entry.get("type")
        if kind == "object":
            found |= lichtblick_fields(entry, path)
        elif kind in PLAIN and "contentEncoding" not in entry:
            found[path] = PLAIN[kind]
        else:
            raise ValueError(f"{path}: unsupported type {kind}")
    return found


def split_path(path: str) -> tuple[str, str]:
    """Topic and field of a message path, in the form of `lichtblick_fields`. Raises `ValueError` for another path."""
    match = PATH.fullmatch(path)
    if match is None:
        raise ValueError(f"{path}: is no message path")
    steps = list(STEP.finditer(match["steps"]))
    if "".join(step[0] for step in steps) != match["steps"]:
        raise ValueError(f"{path}: is no message path")
    return match["topic"], "".join(f".{step['name']}{'[]' if step['slice'] else ''}" for step in steps)


def filter_fields(path: str) -> list[str]:
    """The fields that the filters of a message path compare, in the form of `lichtblick_fields`."""
    found, place = [], ""
    for step in STEP.finditer(PATH.fullmatch(path)["steps"]):  # type: ignore[index]
        place += f".{step['name']}{'[]' if step['slice'] else ''}"
        if step["filter"]:
            found.append(f"{place}.{step['key']}")
    return found


def script_fields(source: str) -> tuple[list[str], str, dict[str, str]]:
    """Inputs, output topic, and the fields of the output type of a user script."""
    inputs = json.loads(re.search(r"^export const inputs = (\[.*\]);$", source, re.MULTILINE)[1])  # type: ignore[index]
    output = re.search(r'^export const output = "([^"]+)";$', source, re.MULTILINE)[1]  # type: ignore[index]
    body = re.search(r"^type \w+ = \{(.*)\};$", source, re.MULTILINE)[1]  # type: ignore[index]
    fields = {f".{name}": "float64" for name in re.findall(r"(\w+): number", body)}
    return inputs, output, fields


def plotjuggler_series(prefix: str, value: object) -> Iterator[str]:
    """The names of the series of a JSON message: numbers and booleans alone."""
    if isinstance(value, dict):
        for key, entry in value.items():
            yield from plotjuggler_series(f"{prefix}/{key}", entry)
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from plotjuggler_series(f"{prefix}[{index}]", entry)
    elif isinstance(value, int | float):
        yield prefix
