"""What a recording contains, so that it is complete in itself: metadata, attachments, and messages as JSON with their schemas.

A field of a message that is null is left out, so that viewers find plain numbers only. Each unit has a resolution well below the
smallest uncertainty of what is measured in it; an uncertainty keeps two significant digits, so that it never becomes zero.
Samples, from which every result can be computed again, and calibration records are exact.

Schemas have the form that MCAP viewers can read. Lichtblick and older Foxglove ignore a topic whose schema has a `$ref`, and
offer no field without a single `type`, which is how "a number or null" is written. References are replaced by their content, and
a field that may be left out has the type of its values and is not required: every number can be plotted.
"""

import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from math import isfinite
from types import NoneType
from typing import Any

import mcap
import msgspec
import numpy as np
from pydantic import TypeAdapter, ValidationError

from devices.block import DeviceInfo
from gateway.errors import describe_problems
from gateway.messages import SCHEMA_VERSION, Calibration, CalibrationSession, Log, Message, Samples
from gateway.topics import TOPICS, adapter

PROFILE = "plumbline"
ORIGIN = "plumbline"
DEVICE = "device"
RECOVERED = "recovered"
REPAIRED = "repaired"
TRIMMED = "trimmed"
CUT = "cut"
"""The metadata record on what a report has cut out of recordings."""
EXPORTED = "exported"
COPIES = {
    CUT: "a cut by plumbline record incident",
    EXPORTED: "an export by plumbline record export",
    RECOVERED: "a copy by plumbline record recover",
}
"""The metadata records of files that were made of recordings, and what such a file is."""
SEGMENT = "segment"
"""In the metadata record of the origin: the number of the segment in the chain of its gateway."""
MAX_SEGMENT_NUMBER = 2**31 - 1
"""Largest number that is believed. Basis: a new segment in each second of 68 years."""
CONFIGURATION = "configuration.toml"
CONFIGURATION_MEDIA_TYPE = "application/toml"
VOUCHER = "voucher.json"
VOUCHER_MEDIA_TYPE = "application/json"
CALIBRATION = "calibration-{id}.json"
CALIBRATION_MEDIA_TYPE = "application/json"
CERTIFICATE = "calibration-{id}.html"
CERTIFICATE_MEDIA_TYPE = "text/html"
DIGITAL_CERTIFICATE = "calibration-{id}.xml"
DIGITAL_CERTIFICATE_MEDIA_TYPE = "application/xml"
TEXT_FIELDS = frozenset({"kind", "device_id", "unit"})
EXACT = (Samples, Calibration, CalibrationSession)
DECIMALS = {
    "_deg": 3,
    "_deg_s": 2,
    "_m_s2": 4,
    "_m_s": 4,
    "_m": 3,
    "_s": 3,
    "_g": 5,
    "_hz": 4,
    "_c": 2,
    "_mb": 1,
    "azimuth_deg": 1,
    "direction_deg": 1,
    "time_to_peak_s": 2,
}
"""Decimals by the end of a field's name, mostly its unit; the longest one decides. Basis: a choice; below the noise of the
supported sensors, and more digits of noise cost space."""
OTHER_DECIMALS = 3
"""Decimals of probabilities and shares. Basis: a choice; a thousandth is more than any decision needs."""
UNCERTAINTY_DIGITS = 2
"""Significant digits (GUM 7.2.6)."""
PLAIN = frozenset({NoneType, str, int, bool})
"""Types of values that JSON takes as they are: a third of all. Definition."""
_ENCODER = msgspec.json.Encoder()
Schema = dict[str, Any]
NULL = {"type": "null"}


def no_voucher() -> None:
    """Vouch for nothing: the site has no CA."""


@dataclass(frozen=True, slots=True)
class RecordingHeader:
    """The gateway, its software and its configuration."""

    software: str
    site: str
    crane: str
    sensor: str
    boot_id: str
    configuration_toml: str
    voucher: Callable[[], str | None] = no_voucher
    """Returns what vouches for the key of the signatures, in JSON; None: nothing does."""

    @property
    def library(self) -> str:
        """Name of the writer in the header of the file."""
        return f"plumbline {self.software}; mcap-python {mcap.__version__}"

    def origin(self) -> dict[str, str]:
        """Return the content of the metadata record `plumbline`."""
        return {
            "schema_version": str(SCHEMA_VERSION),
            "software": self.software,
            "site": self.site,
            "crane": self.crane,
            "sensor": self.sensor,
            "boot_id": self.boot_id,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "machine": platform.machine(),
        }


def segment_number(origin: Mapping[str, str]) -> int:
    """Return the number of a segment from its metadata record `plumbline`; 0: it has none that can be believed."""
    text = origin.get(SEGMENT, "")
    number = int(text) if text.isdecimal() and len(text) <= len(str(MAX_SEGMENT_NUMBER)) else 0
    return number if number <= MAX_SEGMENT_NUMBER else 0


@cache
def _device_adapter() -> TypeAdapter[DeviceInfo]:
    return TypeAdapter(DeviceInfo)


def device_metadata(info: DeviceInfo) -> dict[str, str]:
    """Return the content of the metadata record `device`: texts unchanged, all other fields as JSON."""
    fields = _device_adapter().dump_python(info, mode="json")
    return {name: value if name in TEXT_FIELDS else json.dumps(value) for name, value in fields.items()}


def device_from_metadata(metadata: dict[str, str]) -> DeviceInfo:
    """Return the device of a recording. Raises `ValueError` where the metadata do not describe one."""
    try:
        fields = {name: text if name in TEXT_FIELDS else json.loads(text) for name, text in metadata.items()}
        return _device_adapter().validate_python(fields)
    except ValidationError as error:
        raise ValueError(f"metadata 'device': {describe_problems(error)[0]}") from error


def encode_recorded(message: Message | Log) -> bytes:
    """Encode a message without its fields that are null or not finite."""
    return _ENCODER.encode(_known(message))


def _known(record: Any) -> dict[str, Any]:
    """Return the fields of a message, or of a part of one, that have a value."""
    content = {}
    for name, decimals in _fields(record.__class__):
        value = _plain(getattr(record, name), decimals)
        if value is not None:
            content[name] = value
    return content


def _plain(value: Any, decimals: int | None) -> Any:
    """Return a value as JSON takes it; None for a number, or a list with one, that is not finite."""
    if value.__class__ in PLAIN:
        return value
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return _rounded(value, decimals) if isfinite(value) else None
    if isinstance(value, list) and value and not isinstance(value[0], int | str):
        entries = [_plain(entry, decimals) for entry in value]
        return None if None in entries else entries
    return _known(value) if is_dataclass(value) else value


def _rounded(value: float, decimals: int | None) -> float:
    if decimals is None:
        return value
    if decimals < 0:
        return float(f"{value:.{-decimals}g}")
    return round(value, decimals) + 0.0  # no -0.0


@cache
def _fields(type_: type) -> tuple[tuple[str, int | None], ...]:
    """Return the names of a type's fields with their decimals; negative: significant digits; None: exact."""
    exact = issubclass(type_, EXACT)
    return tuple((field.name, None if exact else decimals_of(field.name)) for field in fields(type_))


def decimals_of(name: str) -> int:
    """Return the number of decimals of a field, or of significant digits as a negative number."""
    if name.startswith("u_") or "_u_" in name:
        return -UNCERTAINTY_DIGITS
    units = [unit for unit in DECIMALS if name.endswith(unit)]
    return DECIMALS[max(units, key=len)] if units else OTHER_DECIMALS


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
