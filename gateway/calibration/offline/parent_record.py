"""Reads the parent record from a file that the user names."""

import json
from pathlib import Path

from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import parse_record
from gateway.errors import InputError


def read_parent(path: Path, device_id: str) -> CalibrationRecord:
    """Return the parent record. Raises `InputError` if the file contains no record, or one of another device."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a calibration record ({error}); name another file") from error
    return parse_record(content, device_id, str(path))
