"""The calibration record in force and its certificates, as attachments of every segment of a recording."""

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.recording.format import header as names

FORBIDDEN_IN_NAME = re.compile(r"[^A-Za-z0-9._-]")
MAX_ID_CHARACTERS = 80
"""Characters of an id in a file name. Basis: a choice; an id is shorter, and a file system takes 255 bytes."""


@dataclass(frozen=True, slots=True)
class AttachedFile:
    """A file inside a recording."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class CalibrationFiles:
    """The attachments for the calibration in force."""

    device_id: str
    """Segments of another device do not contain them."""
    record_id: str
    files: tuple[AttachedFile, ...]


def calibration_files(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord] = ()
) -> CalibrationFiles:
    """Return the record as JSON and its certificates: some 20 to 60 kB, made in a few milliseconds.

    A record that no digital certificate can state has none.
    """
    from gateway.certificate.digital_certificate import render_digital_certificate
    from gateway.certificate.page import render_certificate

    name = FORBIDDEN_IN_NAME.sub("_", record.id)[:MAX_ID_CHARACTERS]  # an attachment is extracted by its name
    content = json.dumps(record.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"
    parts = [
        (names.CALIBRATION, names.CALIBRATION_MEDIA_TYPE, content),
        (names.CERTIFICATE, names.CERTIFICATE_MEDIA_TYPE, render_certificate(record, parent, earlier)),
    ]
    with suppress(CalibrationError):
        parts.append(
            (names.DIGITAL_CERTIFICATE, names.DIGITAL_CERTIFICATE_MEDIA_TYPE, render_digital_certificate(record))
        )
    files = tuple(
        AttachedFile(pattern.format(id=name), media_type, text.encode()) for pattern, media_type, text in parts
    )
    return CalibrationFiles(device_id=record.device_id, record_id=record.id, files=files)
