"""The store of a device's records, and which of them is in force: found by identity, so a swapped sensor never inherits one.

    <data_dir>/calibration/<device_id>/records/<id>.json   a record, never changed
    <data_dir>/calibration/<device_id>/in_force.json       the id in force, and the history of its changes

A file that cannot be read leaves the device without a calibration, and this is reported; no other record replaces it.
"""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, Self
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gateway.atomic_io import write_durably
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.errors import describe_problems
from gateway.file_input import parse_json, read_bounded

ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,119}$"
"""Pattern of a record's id, which is the name of its file."""
IN_FORCE_NAME = "in_force.json"
UNREADABLE_NAME = "in_force.unreadable.json"
RECORDS_FOLDER = "records"
REMEDY = "restore it from a copy, or put a record in force with plumbline remote"


class InForceChange(BaseModel):
    """One change of the record in force."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True)

    time_utc: str
    by: str
    reason: str
    request: str
    """Id of the request for this change."""
    before: str | None = Field(alias="from")
    after: str | None = Field(alias="to")
    """Id of the record in force afterwards; None: the device's factory record, or no record."""


class InForceState(BaseModel):
    """Content of `in_force.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    device_id: str
    in_force: str | None
    history: tuple[InForceChange, ...]
    """Changes, oldest first."""

    @property
    def standing(self) -> tuple[str, ...]:
        """The records that count, by `standing_records`."""
        return standing_records((change.before, change.after) for change in self.history)

    @model_validator(mode="after")
    def _check_history(self) -> Self:
        if (self.history[-1].after if self.history else None) != self.in_force:
            raise ValueError("the record in force is not the one of the last change")
        return self


def standing_records(changes: Iterable[tuple[object, object]]) -> tuple[str, ...]:
    """Return the ids of the records that were in force, without those that were withdrawn.

    `changes` are the ids before and after each change. One back to a record that came into force earlier than the one that it
    replaces, or to none but the factory's, withdraws the latter.
    """
    order: list[str] = []
    withdrawn: set[object] = set()
    for before, after in changes:
        if isinstance(after, str):
            order += [after] if after not in order else []
            withdrawn.discard(after)
        if before in order and (not isinstance(after, str) or order.index(after) < order.index(str(before))):
            withdrawn.add(before)
    return tuple(each for each in order if each not in withdrawn)


class CalibrationStore:
    """The records of one device. Each call reads the disk, so its answer is what a restart would find."""

    def __init__(self, data_dir: Path, device_id: str) -> None:
        self.device_id = device_id
        name = quote(device_id, safe=" ")
        self.folder = data_dir / "calibration" / (name if not name.startswith(".") else f"%2E{name[1:]}")

    def in_force(self) -> CalibrationRecord | None:
        """Return the record in force. Raises `CalibrationError` if it must not be used."""
        record_id = self.state().in_force
        return None if record_id is None else self.record(record_id)

    def state(self) -> InForceState:
        """Return the id of the record in force and its history. Raises `CalibrationError` if they cannot be read."""
        path = self._in_force_path
        content = _read_json(path)
        if content is None:
            return InForceState(device_id=self.device_id, in_force=None, history=())
        try:
            state = InForceState.model_validate(content)
        except ValidationError as error:
            raise CalibrationError(f"{path}: {describe_problems(error)[0]}; {REMEDY}") from error
        if state.device_id != self.device_id:
            raise CalibrationError(f"{path}: belongs to {state.device_id}, not to {self.device_id}; {REMEDY}")
        return state

    def record(self, record_id: str) -> CalibrationRecord:
        """Return a record by its id. Raises `CalibrationError` if it does not exist or must not be used."""
        path = self._record_path(record_id)
        content = _read_json(path)
        if content is None:
            raise CalibrationError(f"{path}: there is no such record; {REMEDY}")
        record = parse_record(content, self.device_id, str(path))
        if record.id != record_id:
            raise CalibrationError(f"{path}: contains record {record.id}; the record is not used")
        return record

    def ids(self) -> list[str]:
        """Return the ids of all records, sorted."""
        return sorted(path.stem for path in (self.folder / RECORDS_FOLDER).glob("[!.]*.json"))

    def offer(self) -> CalibrationRecord | None:
        """Return the newest record whose parent is in force and that never was in force itself; None: there is none.

        Raises `CalibrationError` for a file that cannot be read.
        """
        state = self.state()
        were_in_force = {change.after for change in state.history}
        for record_id in reversed(self.ids()):
            if state.in_force is None or record_id <= state.in_force:  # an id begins with its time
                return None
            if record_id not in were_in_force and (record := self.record(record_id)).parent == state.in_force:
                return record
        return None

    def add(self, record: CalibrationRecord) -> None:
        """Store a record without putting it in force.

        Raises `CalibrationError` if another record has its id, and `OSError`.
        """
        path = self._record_path(record.id)
        if record.device_id != self.device_id:
            raise CalibrationError(f"record {record.id} belongs to {record.device_id}, not to {self.device_id}")
        if path.exists():
            if self.record(record.id).sha256 != record.sha256:
                raise CalibrationError(f"{path}: another record has this id; records are never changed")
            return
        write_durably(path, _json_bytes(record.model_dump(mode="json")))

    def put_in_force(self, record_id: str | None, *, by: str, reason: str, request: str, time_utc: str) -> None:
        """Change the record in force. Raises `CalibrationError` if it cannot be used, and `OSError` if nothing has changed."""
        if record_id is not None:
            self.record(record_id)
        path = self._in_force_path
        try:
            before = self.state()
        except CalibrationError:  # a person may put a record in force nevertheless; the unreadable file is kept
            write_durably(self.folder / UNREADABLE_NAME, path.read_bytes())
            before = InForceState(device_id=self.device_id, in_force=None, history=())
        change = InForceChange(
            time_utc=time_utc, by=by, reason=reason, request=request, before=before.in_force, after=record_id
        )
        after = InForceState(device_id=self.device_id, in_force=record_id, history=(*before.history, change))
        try:
            write_durably(path, _json_bytes(after.model_dump(mode="json", by_alias=True)))
        except OSError:
            if self.state().in_force != record_id:
                raise  # otherwise only the last sync failed, and a restart would find the requested record

    @property
    def _in_force_path(self) -> Path:
        return self.folder / IN_FORCE_NAME

    def _record_path(self, record_id: str) -> Path:
        if not re.fullmatch(ID_PATTERN, record_id):
            raise CalibrationError(
                f"{record_id!r} is no id of a record; an id has letters, digits, dots, dashes and underscores"
            )
        return self.folder / RECORDS_FOLDER / f"{record_id}.json"


def find_record_in_force(data_dir: Path, device_id: str) -> CalibrationRecord | None:
    """Return the record in force of a device, or None. Raises `CalibrationError` if it must not be used."""
    return CalibrationStore(data_dir, device_id).in_force()


def parse_record(content: dict[str, Any], device_id: str, where: str) -> CalibrationRecord:
    """Return the record of this device from parsed JSON. Raises `CalibrationError`."""
    try:
        record = CalibrationRecord.model_validate(content)
    except ValidationError as error:
        raise CalibrationError(f"{where}: {describe_problems(error)[0]}; the record is not used") from error
    if record.device_id != device_id:
        raise CalibrationError(f"{where}: belongs to {record.device_id}, not to {device_id}; the record is not used")
    return record


def _read_json(path: Path) -> dict[str, Any] | None:
    """Return the parsed JSON of a file, or None if the file does not exist. Raises `CalibrationError`."""
    try:
        content: dict[str, Any] = parse_json(read_bounded(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise CalibrationError(f"{path}: cannot be read ({error}); {REMEDY}") from error
    return content


def _json_bytes(content: dict[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
