"""The records of a device and which of them is in force: found by identity, so that a swapped sensor never inherits one.

    <data_dir>/calibration/<device_id>/records/<id>.json   a record, never changed
    <data_dir>/calibration/<device_id>/in_force.json       the id in force, and every change of it

What cannot be read leaves the device without a calibration, and says so; it never falls back on another record.
"""

import json
import re
from pathlib import Path
from typing import Any, Literal, Self
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gateway.atomic_io import write_durably
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.errors import describe_problems

ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,119}$"
"""Of a record: it is a file's name."""


class Change(BaseModel):
    """One change of the record in force."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True)

    time_utc: str
    by: str
    reason: str
    request: str
    """Id of the request that asked for it."""
    before: str | None = Field(alias="from")
    after: str | None = Field(alias="to")
    """None: no record of the store; the device's own factory record, or none at all."""


class InForce(BaseModel):
    """Content of `in_force.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    device_id: str
    in_force: str | None
    history: tuple[Change, ...]
    """Oldest first."""

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.history[-1].after if self.history else None) != self.in_force:
            raise ValueError("the record in force is not the one that the last change named")
        return self


class CalibrationStore:
    """The records of one device. Reads the disk at each call: what it says is what a restart would find."""

    def __init__(self, data_dir: Path, device_id: str) -> None:
        self.device_id = device_id
        name = quote(device_id, safe=" ")
        self.folder = data_dir / "calibration" / (name if not name.startswith(".") else f"%2E{name[1:]}")

    def in_force(self) -> CalibrationRecord | None:
        """The record in force. Raises `CalibrationError` for one that must not be used."""
        record_id = self.state().in_force
        return None if record_id is None else self.record(record_id)

    def state(self) -> InForce:
        """Which record is in force since when. Raises `CalibrationError`."""
        path = self.folder / "in_force.json"
        content = _read(path)
        if content is None:
            return InForce(device_id=self.device_id, in_force=None, history=())
        try:
            state = InForce.model_validate(content)
        except ValidationError as error:
            raise CalibrationError(f"{path}: {describe_problems(error)[0]}; {_MEND}") from error
        if state.device_id != self.device_id:
            raise CalibrationError(f"{path}: belongs to {state.device_id}, not to {self.device_id}; {_MEND}")
        return state

    def record(self, record_id: str) -> CalibrationRecord:
        """A record by its id. Raises `CalibrationError` where there is none, or it must not be used."""
        path = self._path(record_id)
        content = _read(path)
        if content is None:
            raise CalibrationError(f"{path}: there is no such record; {_MEND}")
        record = parse(content, self.device_id, str(path))
        if record.id != record_id:
            raise CalibrationError(f"{path}: holds record {record.id}; the record is not used")
        return record

    def ids(self) -> list[str]:
        """Of all records, by name."""
        return sorted(path.stem for path in (self.folder / "records").glob("[!.]*.json"))

    def add(self, record: CalibrationRecord) -> None:
        """Keep a record; it is not in force by that. Raises `CalibrationError` where another one has its id, and `OSError`."""
        path = self._path(record.id)
        if record.device_id != self.device_id:
            raise CalibrationError(f"record {record.id} belongs to {record.device_id}, not to {self.device_id}")
        if path.exists():
            if self.record(record.id).sha256 != record.sha256:
                raise CalibrationError(f"{path}: is another record of this id; records are never changed")
            return
        write_durably(path, _json(record.model_dump(mode="json")))

    def put_in_force(self, record_id: str | None, *, by: str, reason: str, request: str, time_utc: str) -> None:
        """Change the record in force. Raises `CalibrationError` where it cannot be used, and `OSError`."""
        if record_id is not None:
            self.record(record_id)
        path = self.folder / "in_force.json"
        try:
            before = self.state()
        except CalibrationError:  # a person puts a record in force all the same: what cannot be read is kept beside
            write_durably(self.folder / "in_force.unreadable.json", path.read_bytes())
            before = InForce(device_id=self.device_id, in_force=None, history=())
        change = Change(
            time_utc=time_utc, by=by, reason=reason, request=request, before=before.in_force, after=record_id
        )
        after = InForce(device_id=self.device_id, in_force=record_id, history=(*before.history, change))
        write_durably(path, _json(after.model_dump(mode="json", by_alias=True)))

    def _path(self, record_id: str) -> Path:
        if not re.fullmatch(ID_PATTERN, record_id):
            raise CalibrationError(f"{record_id!r} is no id of a record: letters, digits, dot, dash, underscore")
        return self.folder / "records" / f"{record_id}.json"


_MEND = "restore it from a copy, or put a record in force with plumbline remote"


def find(data_dir: Path, device_id: str) -> CalibrationRecord | None:
    """The record in force of a device, or None. Raises `CalibrationError` for one that must not be used."""
    return CalibrationStore(data_dir, device_id).in_force()


def parse(content: dict[str, Any], device_id: str, where: str) -> CalibrationRecord:
    """A record of this device from parsed JSON. Raises `CalibrationError`."""
    try:
        record = CalibrationRecord.model_validate(content)
    except ValidationError as error:
        raise CalibrationError(f"{where}: {describe_problems(error)[0]}; the record is not used") from error
    if record.device_id != device_id:
        raise CalibrationError(f"{where}: belongs to {record.device_id}, not to {device_id}; the record is not used")
    return record


def _read(path: Path) -> dict[str, Any] | None:
    """Parsed JSON, or None where there is no such file. Raises `CalibrationError`."""
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise CalibrationError(f"{path}: cannot be read ({error}); {_MEND}") from error
    return content


def _json(content: dict[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
