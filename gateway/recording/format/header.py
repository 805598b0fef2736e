"""The metadata and attachments that make a recording complete in itself."""

import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import mcap
import numpy as np
from pydantic import TypeAdapter, ValidationError

from devices.block import DeviceInfo
from gateway.errors import describe_problems
from gateway.messages import SCHEMA_VERSION

PROFILE = "plumbline"
ORIGIN = "plumbline"
DEVICE = "device"
RECOVERED = "recovered"
REPAIRED = "repaired"
TRIMMED = "trimmed"
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
