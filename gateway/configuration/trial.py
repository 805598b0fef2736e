"""The trial of a changed configuration: a journal beside the file, from which every start continues, whatever was cut off.

The steps of a change, each written completely or not at all: the journal, a copy of the file before, the new file. The gateway
then starts again with it. A trial ends when the gateway is healthy (`confirm`) or is not in time (`roll_back`).
"""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from gateway.atomic_io import sync_folder, write_durably
from gateway.file_input import parse_json, read_bounded

MAX_TRIAL_STARTS = 3
"""Starts of the gateway within a trial; at the next one the configuration before is put back. Basis: a choice; power may fail
once within a trial, and a bad configuration is left soon."""

Outcome = Literal["none", "continued", "rolled_back", "edited_locally", "unreadable"]


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
