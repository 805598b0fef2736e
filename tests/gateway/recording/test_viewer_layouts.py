"""The layouts for viewers: every path is in the recorded schemas and in a recording, by the viewers' own rules."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from gateway.recording.format.content import logged_topics, schema_bytes
from tests.gateway.recorded_crane import RecordedCrane
from tests.gateway.recording.viewer_rules import (
    SCRIPT_TOPICS,
    filter_fields,
    lichtblick_fields,
    plotjuggler_series,
    script_fields,
    split_path,
)

VIEWERS = Path(__file__).parents[3] / "docs" / "guides" / "investigator" / "viewers"
LAYOUT = json.loads((VIEWERS / "foxglove-lichtblick.json").read_text())
XML = ET.parse(VIEWERS / "plotjuggler.xml").getroot()
SCHEMAS = {f"/{topic}": lichtblick_fields(json.loads(schema_bytes(topic))) for topic in logged_topics()}
SCRIPTS = [script_fields(script["sourceCode"]) for script in LAYOUT["userNodes"].values()]
KINDS = {"Plot": {"float64", "bool"}, "StateTransitions": {"string", "bool", "float64"}}


def paths_of(kind: str) -> list[str]:
    panels = [panel for name, panel in LAYOUT["configById"].items() if name.startswith(f"{kind}!")]
    return [path["value"] for panel in panels for path in panel["paths"]]


def curves() -> set[str]:
    return {curve.attrib["name"] for curve in XML.iter("curve")}


def snippets() -> dict[str, set[str]]:
    """The sources of each derived curve."""
    found: dict[str, set[str]] = {}
    for snippet in XML.iter("snippet"):
        additional = snippet.find("additional_sources")
        sources = [
            snippet.findtext("linked_source"),
            *(each.text for each in ([] if additional is None else additional)),
        ]
        found[snippet.attrib["name"]] = {source for source in sources if source}
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_every_path_of_the_layout_is_a_plain_field_of_a_recorded_schema(kind: str) -> None:
    schemas = {**SCHEMAS, **{output: fields for _, output, fields in SCRIPTS}}
    assert len(paths_of(kind)) >= 5
    for path in paths_of(kind):
        topic, field = split_path(path)
        assert schemas[topic][field] in KINDS[kind], path
        assert set(filter_fields(path)) <= set(schemas[topic]), path


def test_every_topic_of_a_panel_and_of_a_script_is_recorded() -> None:
    panels = LAYOUT["configById"].values()
    topics = {panel[key] for panel in panels for key in ("topicToRender", "topicPath") if key in panel}
    assert topics == {"/log", "/alert"}
    for inputs, output, _ in SCRIPTS:
        assert output.startswith(SCRIPT_TOPICS)
        topics |= set(inputs)
    assert topics <= set(SCHEMAS)


def test_a_script_reads_fields_of_its_input() -> None:
    (script,) = (node["sourceCode"] for node in LAYOUT["userNodes"].values())
    assert "const { angle_deg, u_deg } = event.message;" in script
    assert {SCHEMAS["/motion"][field] for field in (".angle_deg", ".u_deg")} == {"float64"}


def test_every_panel_is_placed_once() -> None:
    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


def test_the_splitter_of_plotjuggler_has_a_size_for_each_plot() -> None:
    (splitter,) = XML.iter("DockSplitter")
    sizes = [float(size) for size in splitter.attrib["sizes"].split(";")]
    assert int(splitter.attrib["count"]) == len(sizes) == len(splitter.findall("DockArea/plot"))
    assert sum(sizes) == pytest.approx(1.0)


def test_a_path_that_does_not_exist_is_found() -> None:
    topic, field = split_path('/alert.active[:]{rule=="swing"}.limit_rad')
    assert field not in SCHEMAS[topic]
    with pytest.raises(ValueError, match="unsupported type None"):
        lichtblick_fields({"type": "object", "properties": {"angle_deg": {"anyOf": [{"type": "number"}]}}})


@pytest.mark.slow
def test_every_path_and_curve_has_values_in_a_recording(recorded: RecordedCrane) -> None:
    """Decoded with the public reader: plain JSON, and the schemas that stand in the file."""
    fields: dict[str, dict[str, str]] = {}
    series: set[str] = set()
    for path in recorded.files:
        with path.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                assert schema is not None
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                fields.setdefault(channel.topic, lichtblick_fields(json.loads(schema.data)))
                series |= set(plotjuggler_series(channel.topic, json.loads(message.data)))
    for kind, types in KINDS.items():
        for topic, field in map(split_path, paths_of(kind)):
            if not topic.startswith(SCRIPT_TOPICS):
                assert fields[topic][field] in types
                name = f"{topic}{field.replace('.', '/')}"
                indexed = {one for one in series if name == one.replace("[0]", "[]").replace("[1]", "[]")}
                assert kind == "StateTransitions" or indexed, name
    derived = snippets()
    assert curves() - set(derived) <= series
    assert set().union(*derived.values()) <= series
    assert set(derived) <= curves()
