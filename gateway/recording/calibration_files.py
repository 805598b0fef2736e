"""The record in force and its certificate, as files that every segment of a recording carries."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.page import render_certificate
from gateway.recording import header as names

NOT_IN_A_NAME = re.compile(r"[^A-Za-z0-9._-]")
LONGEST_ID = 80


@dataclass(frozen=True, slots=True)
class AttachedFile:
    """A file inside a recording."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class CalibrationFiles:
    """What a recording carries of the calibration in force."""

    device_id: str
    """Segments of another device do not carry it."""
    record_id: str
    files: tuple[AttachedFile, ...]


def calibration_files(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord] = ()
) -> CalibrationFiles:
    """The record as JSON, as its hash wants it, and its certificate; some 10 to 40 kB, made in a few milliseconds."""
    name = NOT_IN_A_NAME.sub("_", record.id)[:LONGEST_ID]  # the file is taken out by name
    content = json.dumps(record.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"
    return CalibrationFiles(
        device_id=record.device_id,
        record_id=record.id,
        files=(
            AttachedFile(names.CALIBRATION.format(id=name), names.CALIBRATION_MEDIA_TYPE, content.encode()),
            AttachedFile(
                names.CERTIFICATE.format(id=name),
                names.CERTIFICATE_MEDIA_TYPE,
                render_certificate(record, parent, earlier).encode(),
            ),
        ),
    )
