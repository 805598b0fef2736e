"""Reads the files that a user names for a calibration: recordings at rest, and calibration records.

A recording is the project's CSV, or a table in counts, volts, m/s² or g from elsewhere.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from devices.tables.foreign import TableOptions, UnitRange, read_foreign_table
from gateway.calibration.pose import RawReadings
from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import (
    IN_FORCE_NAME,
    RECORDS_FOLDER,
    UNREADABLE_NAME,
    InForceState,
    parse_record,
)
from gateway.errors import InputError, describe_problems
from gateway.file_input import parse_json, read_bounded, reason_of
from gateway.numerics.array import Array

RANGES_AT_REST = (
    UnitRange("counts", 50.0, np.inf),
    UnitRange("g", 0.7, 1.3),
    UnitRange("m/s2", 8.0, 11.5),
    UnitRange("V", 0.2, 7.0),
)
"""Ranges of the median magnitude of the readings of an uncalibrated sensor at rest; in V: three outputs near the middle of a
supply of at most 5 V. Basis: 9.81 m/s2 within the sensitivity and offset of an uncalibrated sensor."""

STORE_FILES = IN_FORCE_NAME, UNREADABLE_NAME, "drift.json", "session.json"
"""Files of a store that are no records."""
FED_READINGS = 64
"""Number of readings of a block. Basis: the result does not depend on it."""


@dataclass(frozen=True, slots=True)
class FileReadings:
    """Readings of one file, in the unit of the record."""

    path: Path
    unit: Literal["g", "V", "counts"]
    time_s: Array
    raw: Array
    """Readings, shape (n, 3)."""
    temperature_c: Array | None
    """Temperatures, shape (n,), NaN for a row without one."""
    n_skipped: int
    """Number of rows that could not be used."""
    unit_is_stated: bool = False
    """Whether the file or the user states the unit; otherwise it is found from names or numbers."""
    units_per_g: float | None = None
    """Nominal sensitivity of the device; None: the file does not state it."""
    device_id: str | None = None
    """Identity of the device; None: the file does not state it."""

    def blocks(self) -> Iterator[RawReadings]:
        """Yield the readings in blocks, each with its mean temperature, as a device delivers them."""
        for start in range(0, len(self.time_s), FED_READINGS):
            part = slice(start, start + FED_READINGS)
            temperature_c = None
            if self.temperature_c is not None and not np.all(np.isnan(self.temperature_c[part])):
                temperature_c = float(np.nanmean(self.temperature_c[part]))
            yield RawReadings(self.time_s[part], self.raw[part], temperature_c)


def read_file(path: Path, options: TableOptions) -> FileReadings:
    """Read one file. Raises `RecordingError` with the file and the remedy."""
    table = read_foreign_table(path, options, RANGES_AT_REST)
    recording = table.recording
    return FileReadings(
        path=path,
        unit=table.unit if table.unit in ("counts", "V") else "g",
        time_s=recording.time_s,
        raw=recording.raw,
        temperature_c=recording.temperature_c,
        n_skipped=recording.invalid + recording.repeated + recording.backward + recording.truncated,
        unit_is_stated=options.unit is not None,
    )


@dataclass(frozen=True, slots=True)
class ReadRecords:
    """The calibration records of files, each once."""

    counted: list[CalibrationRecord]
    not_counted: list[CalibrationRecord]
    """Those that were never in force by the history beside them, or were withdrawn."""
    notes: tuple[str, ...]
    """What was left out, and why."""


def read_records(paths: Sequence[Path]) -> ReadRecords:
    """Return the records of files and of all `.json` files below folders.

    A file that is named must be a record; below a folder other files are left out with a note, those of the store without one.
    Raises `InputError` for a named file that is none, and where nothing is a record.
    """
    counted: dict[str, CalibrationRecord] = {}
    others: dict[str, CalibrationRecord] = {}
    notes = []
    for path in paths:
        for file in sorted(path.rglob("*.json")) if path.is_dir() else [path]:
            if file != path and file.name in STORE_FILES:
                continue
            try:
                record = read_record(file)
                if (reason := _not_in_force(file, record)) is None:
                    counted[record.sha256] = record
                    continue
                others[record.sha256] = record
                notes.append(f"left out: {file}: {reason}")
            except InputError as error:
                if file == path:
                    raise
                notes.append(f"left out: {error}")
    if not counted and not others:
        raise InputError(
            f"{', '.join(map(str, paths))}: contain no calibration record; name records or a store's folder"
        )
    return ReadRecords(list(counted.values()), list(others.values()), tuple(notes))


def _not_in_force(path: Path, record: CalibrationRecord) -> str | None:
    """Return why a record does not count by the history of its store or its copy; None: it counts, or there is no history."""
    folder = path.parent.parent if path.parent.name == RECORDS_FOLDER else path.parent
    if not (folder / IN_FORCE_NAME).exists():
        return None
    try:
        state = InForceState.model_validate(_read_content(folder / IN_FORCE_NAME))
    except (InputError, ValidationError):
        return None  # the gateway itself reports it
    if state.device_id != record.device_id or record.id in state.standing:
        return None
    withdrawn = [change for change in state.history if change.before == record.id]
    if not withdrawn:
        return "it was never in force"
    last = withdrawn[-1]
    return f"it was withdrawn on {last.time_utc[:10]} by {last.by}" + (f": {last.reason}" if last.reason else "")


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
