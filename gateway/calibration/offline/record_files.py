"""Reads calibration records, one or many, from files and folders that the user names."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import parse_record
from gateway.errors import InputError, describe_problems
from gateway.file_input import parse_json, read_bounded, reason_of


def read_records(paths: Sequence[Path]) -> tuple[list[CalibrationRecord], tuple[str, ...]]:
    """Return the records of files and of all `.json` files below folders, each once, and notes on files left out.

    A file that is named must be a record; below a folder other files are left out with a note. Raises `InputError` for a named
    file that is none, and where nothing is a record.
    """
    records: dict[str, CalibrationRecord] = {}
    notes = []
    for path in paths:
        for file in sorted(path.rglob("*.json")) if path.is_dir() else [path]:
            try:
                record = read_record(file)
            except InputError as error:
                if file == path:
                    raise
                notes.append(f"left out: {error}")
            else:
                records[record.sha256] = record
    if not records:
        raise InputError(
            f"{', '.join(map(str, paths))}: contain no calibration record; name records or a store's folder"
        )
    return list(records.values()), tuple(notes)


def read_record(path: Path) -> CalibrationRecord:
    """Return the record of a file. Raises `InputError` where it is none."""
    try:
        return CalibrationRecord.model_validate(_read_content(path))
    except ValidationError as error:
        raise InputError(f"{path}: is no calibration record: {describe_problems(error)[0]}") from error


def read_parent(path: Path, device_id: str) -> CalibrationRecord:
    """Return the parent record. Raises `InputError` if the file contains no record, or one of another device."""
    return parse_record(_read_content(path), device_id, str(path))


def _read_content(path: Path) -> Any:
    try:
        return parse_json(read_bounded(path))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: cannot be read as a calibration record ({reason_of(error)}); name another file"
        ) from error
