"""Reads the parent record from a file that the user names."""

from pathlib import Path

from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import parse_record
from gateway.errors import InputError
from gateway.file_input import parse_json, read_bounded


def read_parent(path: Path, device_id: str) -> CalibrationRecord:
    """Return the parent record. Raises `InputError` if the file contains no record, or one of another device."""
    try:
        content = parse_json(read_bounded(path))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a calibration record ({error}); name another file") from error
    return parse_record(content, device_id, str(path))
