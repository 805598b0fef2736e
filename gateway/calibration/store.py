"""Which record belongs to a device: found by identity, so that a swapped sensor never inherits one."""

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gateway.calibration.record import CalibrationError, CalibrationRecord


def record_path(data_dir: Path, device_id: str) -> Path:
    """Where the record in force of a device lies."""
    return data_dir / "calibration" / f"{device_id.replace('/', '_')}.json"


def find(data_dir: Path, device_id: str) -> CalibrationRecord | None:
    """The stored record of a device, or None. Raises `CalibrationError` for one that must not be used."""
    path = record_path(data_dir, device_id)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise CalibrationError(
            f"{path}: cannot be read as a calibration record ({error}); restore or remove it"
        ) from error
    return parse(content, device_id, str(path))


def parse(content: dict[str, Any], device_id: str, where: str) -> CalibrationRecord:
    """A record of this device from parsed JSON. Raises `CalibrationError`."""
    try:
        record = CalibrationRecord.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "record"
        raise CalibrationError(f"{where}: {place}: {first['msg']}; the record is not used") from error
    if record.device_id != device_id:
        raise CalibrationError(f"{where}: belongs to {record.device_id}, not to {device_id}; the record is not used")
    return record
