"""The format of recordings: the MCAP writer, read with the reader of its authors, and the schemas in a file.

The schemas are true of every message, and read by viewers that know little of JSON Schema.
"""

import io
import json
import struct
import zlib
from dataclasses import fields, replace
from typing import Any, get_args, get_origin, get_type_hints

import pytest
from mcap.reader import make_reader

from gateway import messages
from gateway.recording.format.content import encode_recorded, logged_topics, schema_bytes
from gateway.recording.format.mcap_writer import CHUNK_BYTES, McapWriter
from gateway.topics import TOPICS, adapter, encode, json_schema
from tests.gateway.recording.conftest import EVERY_MESSAGE, SECOND_NS
from tests.gateway.recording.viewer_rules import lichtblick_fields

TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "null": (type(None),),
}
STANDING = {
    "rule": "swing",
    "level": "trip",
    "since_ns": 0,
    "value_deg": 6.2,
    "limit_deg": 6.0,
    "clear_deg": 3.0,
    "text": "swing 6.2 deg",
}
ANNOTATIONS = {"title", "description", "default"}
CHECKED = {
    "type",
    "properties",
    "required",
    "additionalProperties",
    "items",
    "minItems",
    "maxItems",
    "enum",
    "const",
}


def written(payload: bytes = b"{}", messages: int = 4) -> io.BytesIO:
    file = io.BytesIO()
    writer = McapWriter(file)
    writer.start("plumbline", "test")
    schema_id = writer.register_schema("plumbline.Test", "jsonschema", b'{"type":"object"}')
    channels = [writer.register_channel(topic, "json", schema_id) for topic in ("/a", "/b")]
    for number in range(messages):
        writer.add_message(channels[number % 2], number, number * SECOND_NS, number * SECOND_NS + 5, payload)
        if number == 1:
            writer.flush()
    writer.add_metadata("origin", {"site": "s"})
    writer.add_attachment(create_time=1, log_time=2, name="file", media_type="text/plain", data=b"text")
    writer.finish()
    file.seek(0)
    return file


def test_the_checksums_are_valid_and_every_message_is_read() -> None:
    reader = make_reader(written(), validate_crcs=True)
    read = [(channel.topic, message.sequence, message.log_time) for _, channel, message in reader.iter_messages()]
    assert read == [("/a", 0, 0), ("/b", 1, SECOND_NS), ("/a", 2, 2 * SECOND_NS), ("/b", 3, 3 * SECOND_NS)]
    assert [attachment.data for attachment in reader.iter_attachments()] == [b"text"]
    assert [record.metadata for record in reader.iter_metadata()] == [{"site": "s"}]


def test_the_statistics_count_what_was_written() -> None:
    summary = make_reader(written()).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.channel_message_counts == {1: 2, 2: 2}
    assert (summary.statistics.chunk_count, len(summary.chunk_indexes)) == (2, 2)
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 3 * SECOND_NS)


def test_messages_are_found_by_time_and_topic() -> None:
    reader = make_reader(written())
    found = [message.sequence for _, _, message in reader.iter_messages(["/a"], starting_at=SECOND_NS)]
    assert found == [2]


def test_a_long_chunk_ends_by_itself() -> None:
    summary = make_reader(written(payload=bytes(CHUNK_BYTES), messages=6)).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 6


def test_the_footer_holds_the_checksum_of_the_summary() -> None:
    data = written().getvalue()
    summary_start, _, crc = struct.unpack("<QQI", data[-28:-8])
    assert zlib.crc32(data[summary_start:-12]) == crc


def faults(value: Any, schema: dict[str, Any], path: str = "$") -> list[str]:
    """Where a value breaks a schema: the part of JSON Schema 2020-12 that these schemas use, and no other word."""
    assert set(schema) <= CHECKED | ANNOTATIONS, f"{path}: unexpected {set(schema) - CHECKED - ANNOTATIONS}"
    found: list[str] = []
    if "type" in schema:
        wrong_bool = isinstance(value, bool) and schema["type"] != "boolean"
        if wrong_bool or not isinstance(value, TYPES[schema["type"]]):
            found.append(f"{path}: {value!r} is no {schema['type']}")
    allowed = schema.get("enum", [schema.get("const", value)])
    if value not in allowed:
        found.append(f"{path}: {value!r} is not one of {allowed}")
    if isinstance(value, dict):
        found += object_faults(value, schema, path)
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            found.append(f"{path}: {len(value)} entries")
        for entry in value:
            found += faults(entry, schema.get("items", {}), f"{path}[]")
    return found


def object_faults(value: dict[str, Any], schema: dict[str, Any], path: str) -> list[str]:
    found = [f"{path}: {name} is missing" for name in schema.get("required", []) if name not in value]
    properties = schema.get("properties", {})
    others = schema.get("additionalProperties", True)
    for name, entry in value.items():
        if name in properties:
            found += faults(entry, properties[name], f"{path}.{name}")
        elif isinstance(others, dict):
            found += faults(entry, others, f"{path}.{name}")
    return found


@pytest.mark.parametrize("topic", logged_topics())
def test_every_message_is_valid_by_its_schema(topic: str) -> None:
    content = json.loads(encode_recorded(EVERY_MESSAGE[topic]))
    assert faults(content, json.loads(schema_bytes(topic))) == []


@pytest.mark.parametrize(
    ("topic", "change"),
    [
        ("tilt", {"axial_deg": "12"}),
        ("tilt", {"axial_deg": True}),
        ("tilt", {"specific_force_g": [1.0, 2.0]}),
        ("samples", {"x": [None]}),
        ("samples", {"lost": 0.5}),
        ("samples", {"clock": "late"}),
        ("tilt", {"schema_version": 2}),
        ("condition", {"gates": {"norm": 1}}),
        ("swing", {"formulas_deg": {"arccos_min_az": None}}),
        ("motion", {"angle_deg": None}),
        ("alert", {"active": [{"rule": "swing"}]}),
        ("alert", {"active": [{**STANDING, "clear_deg": "3"}]}),
    ],
)
def test_a_wrong_message_is_invalid_by_its_schema(topic: str, change: dict[str, Any]) -> None:
    content = {**json.loads(encode_recorded(EVERY_MESSAGE[topic])), **change}
    assert faults(content, json.loads(schema_bytes(topic)))


def test_a_message_without_its_time_is_invalid() -> None:
    content = json.loads(encode_recorded(EVERY_MESSAGE["swing"]))
    del content["time_ns"]
    assert faults(content, json.loads(schema_bytes("swing"))) == ["$: time_ns is missing"]


@pytest.mark.parametrize("topic", logged_topics())
def test_what_is_not_known_is_left_out_and_read_as_null(topic: str) -> None:
    recorded = encode_recorded(EVERY_MESSAGE[topic])
    assert None not in json.loads(recorded).values()
    assert adapter(topic).validate_json(recorded) == EVERY_MESSAGE[topic]


def test_a_number_that_is_not_finite_is_left_out() -> None:
    motion = EVERY_MESSAGE["motion"]
    assert isinstance(motion, messages.Motion)
    broken = replace(motion, angle_deg=float("nan"), pivot_accel_m_s2=[float("inf"), 0.0])
    assert not {"angle_deg", "pivot_accel_m_s2"} & set(json.loads(encode_recorded(broken)))


def test_recorded_numbers_have_the_digits_that_their_unit_justifies() -> None:
    motion = messages.Motion(
        time_ns=1_700_000_000_123_456_789,
        clock="synchronised",
        sequence=1,
        state="free",
        angle_deg=3.14159265,
        u_deg=0.031415926,
        azimuth_deg=-0.01,
        rate_deg_s=-2.71828,
        hoist_u_m_s=0.00000314159,
        pivot_accel_m_s2=[0.123456, -0.00000012],
        reasons=[],
        text="",
    )
    recorded = json.loads(encode_recorded(motion))
    del recorded["schema_version"], recorded["clock"], recorded["reasons"], recorded["text"], recorded["state"]
    assert recorded == {
        "time_ns": 1_700_000_000_123_456_789,
        "sequence": 1,
        "angle_deg": 3.142,
        "u_deg": 0.031,
        "azimuth_deg": 0.0,
        "rate_deg_s": -2.72,
        "hoist_u_m_s": 3.1e-6,
        "pivot_accel_m_s2": [0.1235, 0.0],
    }
    assert b"-0.0" not in encode_recorded(motion)


def test_samples_and_calibrations_are_recorded_exactly() -> None:
    samples = EVERY_MESSAGE["samples"]
    assert isinstance(samples, messages.Samples)
    exact = replace(samples, unit="g", packing="plain", x=[0.123456789012345], period_ns=1000000.0312345)
    assert json.loads(encode_recorded(exact))["x"] == [0.123456789012345]
    assert json.loads(encode_recorded(exact))["period_ns"] == 1000000.0312345


@pytest.mark.parametrize("topic", logged_topics())
def test_on_the_bus_every_field_is_sent_and_required(topic: str) -> None:
    names = {field.name for field in fields(TOPICS[topic].type)}
    assert set(json.loads(encode(EVERY_MESSAGE[topic]))) == names == set(json_schema(topic)["required"])


@pytest.mark.parametrize("topic", logged_topics())
def test_viewers_offer_every_number_of_a_message(topic: str) -> None:
    type_ = TOPICS[topic].type
    hints = get_type_hints(type_)
    numbers = {
        name
        for name, hint in hints.items()
        if get_origin(hint) not in (dict, list) and {float, int} & {hint, *get_args(hint)}
    }
    assert numbers or topic == "log"
    properties = json.loads(schema_bytes(topic))["properties"]
    assert {properties[name]["type"] for name in numbers} <= {"number", "integer"}


@pytest.mark.parametrize("topic", [name for name in logged_topics() if name != "log"])
def test_every_message_states_the_version_of_its_schema(topic: str) -> None:
    assert json.loads(encode_recorded(EVERY_MESSAGE[topic]))["schema_version"] == 1
    schema = json.loads(schema_bytes(topic))
    assert schema["properties"]["schema_version"]["const"] == 1


def test_messages_without_a_version_have_the_first_one() -> None:
    content = json.loads(encode_recorded(EVERY_MESSAGE["tilt"]))
    del content["schema_version"]
    assert adapter("tilt").validate_python(content).schema_version == 1


def test_alerts_recorded_before_the_clear_level_was_a_field_remain_readable() -> None:
    content = json.loads(encode_recorded(EVERY_MESSAGE["alert"]))
    assert content["active"][0].pop("clear_deg") == 3.0
    assert faults(content, json.loads(schema_bytes("alert"))) == []
    assert adapter("alert").validate_python(content).active[0].clear_deg is None


@pytest.mark.parametrize("topic", logged_topics())
def test_viewers_can_read_the_schema_of_every_topic(topic: str) -> None:
    assert lichtblick_fields(json.loads(schema_bytes(topic)))


def test_the_log_has_the_schema_foxglove_log() -> None:
    schema = json.loads(schema_bytes("log"))
    assert schema["title"] == "foxglove.Log"
    fields = [".timestamp.sec", ".timestamp.nsec", ".level", ".message", ".name", ".file", ".line"]
    assert list(lichtblick_fields(schema)) == fields
