"""The record in force, from a file that the user names."""

import json
from pathlib import Path

from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import parse
from gateway.errors import InputError


def read_parent(path: Path, device_id: str) -> CalibrationRecord:
    """Raises `InputError` for a file that is no record, or that of another device."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a calibration record ({error}); name another file") from error
    return parse(content, device_id, str(path))
