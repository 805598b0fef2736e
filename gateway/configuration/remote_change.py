"""What the disk keeps of changes of the configuration over the bus: the trial of a change, and the limits of commissioning.

The steps of a change, each written completely or not at all: the journal beside the file, a copy of the file before, the new
file. The gateway then starts again with it, and every start continues from the journal, whatever was cut off. A trial ends when
the gateway is healthy (`confirm`) or is not in time (`roll_back`).

While limits of the alerts are in force that are not those from before they were first changed over the bus, the gateway says so.
A limit that a person sets in the file of the configuration, on the gateway's own machine, is commissioned by that; one that came
over the bus is accepted by deleting the file in the data folder.
"""

import hashlib
import json
from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from gateway.atomic_io import make_folder, sync_folder, write_durably
from gateway.configuration.model import AlertsSection
from gateway.file_input import parse_json, read_bounded

MAX_TRIAL_STARTS = 3
"""Starts of the gateway within a trial; at the next one the configuration before is put back. Basis: a choice; power may fail
once within a trial, and a bad configuration is left soon."""

Outcome = Literal["none", "continued", "rolled_back", "edited_locally", "unreadable"]
NAME = Path("configuration") / "commissioned.json"
"""Place in the data folder."""
Limits = dict[str, float]
"""Values in the units of the configuration, by key of its section `[alerts]`."""


class TrialJournal(BaseModel):
    """Content of `<configuration>.trial.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    id: str
    by: str
    reason: str
    before: str
    """Text of the file before the change."""
    after: str
    kept: str
    """Name of the copy of the file before."""
    starts: int = 0
    rolled_back: str | None = None
    """Why the configuration before was put back; None: the trial goes on."""


class ConfigurationTrial:
    """The trial of one configuration file. All methods raise `OSError` where the disk fails; what is on it stays consistent."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._journal_path = path.with_name(f"{path.name}.trial.json")

    def begin(self, journal: TrialJournal) -> None:
        """Put a changed configuration into force for a trial."""
        self._write_journal(journal)
        write_durably(self.path.with_name(journal.kept), journal.before.encode())
        self._write_settings(journal.after)

    def resume(self) -> Outcome:
        """Continue at a start: count it, or put the configuration before back after too many."""
        try:
            journal = self.journal()
        except ValueError:
            self._journal_path.replace(self._journal_path.with_suffix(".damaged"))
            return "unreadable"
        if journal is None:
            return "none"
        present = self.path.read_text(encoding="utf-8", errors="replace")
        if present == journal.before:
            self.roll_back(journal.rolled_back or "the change was cut off")
            return "rolled_back"
        if present != journal.after:
            self.end()
            return "edited_locally"
        if journal.starts >= MAX_TRIAL_STARTS or journal.rolled_back is not None:
            self.roll_back(journal.rolled_back or f"the gateway did not become healthy in {MAX_TRIAL_STARTS} starts")
            return "rolled_back"
        self._write_journal(journal.model_copy(update={"starts": journal.starts + 1}))
        return "continued"

    def journal(self) -> TrialJournal | None:
        """Return the trial in progress, or the one that was rolled back; None: there is none. Raises `ValueError`: damaged."""
        try:
            return TrialJournal.model_validate(parse_json(read_bounded(self._journal_path)))
        except FileNotFoundError:
            return None
        except ValidationError as error:
            raise ValueError(f"{self._journal_path}: {error.error_count()} problems") from error

    def roll_back(self, why: str) -> None:
        """Put the configuration before back; the journal states why, until `end`."""
        journal = self.journal()
        if journal is not None:
            self._write_journal(journal.model_copy(update={"rolled_back": why}))
            self._write_settings(journal.before)

    def end(self) -> None:
        """End the trial with the present configuration."""
        self._journal_path.unlink(missing_ok=True)
        sync_folder(self._journal_path.parent)

    def _write_settings(self, text: str) -> None:
        """Replace the file; who could read it still can."""
        mode = self.path.stat().st_mode & 0o777
        write_durably(self.path, text.encode())
        self.path.chmod(mode)

    def _write_journal(self, journal: TrialJournal) -> None:
        write_durably(self._journal_path, journal.model_dump_json(indent=1).encode())


class CommissionedLimits(BaseModel):
    """Content of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    commissioned: Limits
    changed: Limits
    """What was last set over the bus."""
    sha256: str = ""

    @model_validator(mode="after")
    def _check_sum(self) -> Self:
        if self.sha256 != self.checksum:
            raise ValueError("its checksum is wrong")
        return self

    @property
    def checksum(self) -> str:
        """SHA-256 of the limits."""
        return hashlib.sha256(json.dumps([self.commissioned, self.changed], sort_keys=True).encode()).hexdigest()


def note_change(data_dir: Path, before: AlertsSection, after: AlertsSection) -> None:
    """Keep what was commissioned before limits are changed over the bus. Raises `OSError`."""
    old, new = _limits(before), _limits(after)
    if old == new:
        return
    try:
        known = _read(data_dir)
    except ValueError:
        return  # it is said that it cannot be read, until a person deletes it
    if known is not None:
        old = {
            key: known.commissioned.get(key, value)
            if value in (known.commissioned.get(key), known.changed.get(key))
            else value
            for key, value in old.items()
        }
    unsigned = CommissionedLimits.model_construct(commissioned=old, changed=new)
    path = data_dir / NAME
    make_folder(path.parent)
    write_durably(path, unsigned.model_copy(update={"sha256": unsigned.checksum}).model_dump_json(indent=1).encode())


def describe_changes(data_dir: Path, present: AlertsSection) -> list[str]:
    """Return a line for each limit that was changed over the bus and is not as it was commissioned."""
    accept = f"; to accept it, delete {data_dir / NAME} and restart the gateway"
    try:
        known = _read(data_dir)
    except (OSError, ValueError) as error:
        return [f"the limits of commissioning cannot be read ({error}){accept}"]
    if known is None:
        return []
    return [
        f"alerts.{key} is {value:g}, changed over the bus; at commissioning it was {known.commissioned[key]:g}{accept}"
        for key, value in _limits(present).items()
        if key in known.commissioned and value == known.changed.get(key) != known.commissioned[key]
    ]


def _limits(section: AlertsSection) -> Limits:
    return {key: float(value) for key, value in section.model_dump().items()}


def _read(data_dir: Path) -> CommissionedLimits | None:
    """Return the content of the file; None: there is none. Raises `OSError` and `ValueError`."""
    path = data_dir / NAME
    try:
        return CommissionedLimits.model_validate_json(read_bounded(path))
    except FileNotFoundError:
        if path.is_symlink():
            raise
        return None
    except ValidationError as error:
        raise ValueError(f"{error.error_count()} problems") from error
