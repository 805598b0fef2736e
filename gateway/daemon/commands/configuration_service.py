"""Changes of the configuration over the bus: proposed, applied on trial, confirmed or rolled back by the gateway's health."""

import logging
import threading
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from gateway.atomic_io import write_durably
from gateway.configuration.loading import ConfigurationError, load_text, require_sensor
from gateway.configuration.model import AlertsSection
from gateway.configuration.proposal import CheckedProposal, check_proposal, text_hash, visible_part
from gateway.configuration.remote_change import ConfigurationTrial, Outcome, TrialJournal, describe_changes, note_change
from gateway.daemon.commands.requests import RemoteRequest, RequestHandler
from gateway.file_input import parse_json, parse_toml, read_bounded
from gateway.recalibration.journal import Audit
from gateway.recalibration.requests import ApplyConfiguration, ProposeConfiguration, ReadConfiguration, Request

log = logging.getLogger("plumbline.configuration")
FOLDER = "configuration"
HISTORY = 20
"""Earlier changes that are kept. Basis: a choice; more than an operator goes back, and a file of a few kilobytes."""
HEALTHY_S = 10.0
"""Uninterrupted health that confirms a configuration. Basis: a choice; ten messages of the health, and a sixth of the time that a
trial has."""
DEADLINE_S = 60.0
"""Time after the start in which a configuration must become healthy. Basis: a choice; several times `HEALTHY_S`, and short for a
gateway that does not measure."""


class StoredProposal(BaseModel):
    """Content of `<data_dir>/configuration/proposal.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    request: ProposeConfiguration
    file_sha256: str
    """Hash of the file that it changes."""


class ConfigurationService:
    """Serves the verbs of the configuration and ends trials, in the thread of the commands."""

    def __init__(self, path: Path | None, *, service: bool, environment: Mapping[str, str]) -> None:
        """`path` is the file of the configuration; None: there is none, and nothing can be changed."""
        self.trial = None if path is None else ConfigurationTrial(path)
        self._service = service
        self._environment = environment
        self.restart_wanted = False
        """Whether the gateway must end, and start again with another configuration."""
        self.changed_limits: list[str] = []
        """A line for each limit of the alerts that was changed over the bus since commissioning."""
        self._audit: Audit | None = None
        self._data_dir = Path()
        self._proposal_path = Path(FOLDER)

    def resume(self) -> Outcome:
        """Continue a trial at the start, before the configuration is loaded."""
        if self.trial is None:
            return "none"
        try:
            return self.trial.resume()
        except OSError as error:
            log.error("the trial of the configuration could not be continued: %s", error)
            return "none"

    def open(self, data_dir: Path) -> dict[str, RequestHandler]:
        """Start in a gateway; return the handlers of the verbs. A trial that was rolled back is noted in the audit."""
        self._audit = Audit(data_dir / FOLDER / "audit.jsonl", log.warning)
        self._data_dir, self._proposal_path = data_dir, data_dir / FOLDER / "proposal.json"
        journal = self._journal()
        if self.trial is not None and journal is not None and journal.rolled_back is not None:
            try:
                self._note("rolled_back", journal, why=journal.rolled_back)
                self.trial.end()
            except OSError as error:
                log.error("the rollback of the configuration cannot be noted: %s", error)
        return {
            "config_get": lambda request: self._handle(request, self._read),
            "config_propose": lambda request: self._handle(request, self._propose),
            "config_apply": lambda request: self._handle(request, self._apply),
        }

    def compare_limits(self, alerts: AlertsSection) -> None:
        """Compare the limits in force with those of commissioning. Called by the thread of the remote calls, once."""
        self.changed_limits = describe_changes(self._data_dir, alerts)
        for line in self.changed_limits:
            log.warning("%s", line)

    @property
    def on_trial(self) -> bool:
        """Whether a changed configuration waits for its confirmation."""
        journal = self._journal()
        return journal is not None and journal.rolled_back is None

    def confirm(self) -> None:
        """Keep the configuration on trial: the gateway is healthy."""
        journal = self._journal()
        if self.trial is not None and journal is not None:
            self._note("confirmed", journal)
            self.trial.end()

    def roll_back(self, why: str) -> None:
        """Put the configuration before back, and have the gateway start again. Raises `OSError`."""
        if self.trial is not None:
            log.error("the configuration on trial is rolled back: %s", why)
            self.trial.roll_back(why)
            self.restart_wanted = True

    def _handle(self, request: RemoteRequest, answer: Callable[[RemoteRequest, Path], dict[str, Any]]) -> None:
        """Answer a request, or refuse it with the reason."""
        if self.trial is None:
            request.refuse("this gateway runs without a configuration file; start it with --config FILE")
            return
        try:
            content = answer(request, self.trial.path)
        except (ConfigurationError, OSError) as error:
            request.refuse(str(error))
            return
        request.reply(True, {"id": request.expect(Request).id, "accepted": True, **content})
        if request.verb == "config_apply":
            self.restart_wanted = True

    def _read(self, request: RemoteRequest, path: Path) -> dict[str, Any]:
        request.expect(ReadConfiguration)
        table = parse_toml(path.read_text(encoding="utf-8"))
        journal = self._journal()
        return {
            "text": f"configuration of {path}",
            "configuration": visible_part(table),
            "on_trial": None if journal is None else journal.id,
            "history": [] if self._audit is None else self._audit.newest(HISTORY),
        }

    def _propose(self, request: RemoteRequest, path: Path) -> dict[str, Any]:
        wanted = request.expect(ProposeConfiguration)
        text = path.read_text(encoding="utf-8")
        checked = self._check(text, wanted)
        before = self._stored_proposal() if wanted.keep else None
        is_voided = before is not None and before.request.id != wanted.id and before.file_sha256 == text_hash(text)
        if wanted.keep:
            request.begin()
            stored = StoredProposal(request=wanted, file_sha256=text_hash(text))
            write_durably(self._proposal_path, stored.model_dump_json(indent=1).encode())
            self._note("proposed", wanted, changes=[str(change) for change in checked.changes])
        return {
            "text": f"{len(checked.changes)} keys change",
            "proposal": wanted.id if wanted.keep else None,
            "voids": before.request.id if before is not None and is_voided else None,
            "changes": [change.model_dump() for change in checked.changes],
        }

    def _apply(self, request: RemoteRequest, path: Path) -> dict[str, Any]:
        wanted = request.expect(ApplyConfiguration)
        journal = self._journal()
        if journal is not None and journal.id == wanted.id:
            return {"text": "on trial"}  # the answer to an earlier copy of this request was lost
        if journal is not None:
            raise ConfigurationError("a configuration is on trial; wait for its confirmation")
        stored, text = self._stored_proposal(), path.read_text(encoding="utf-8")
        if stored is None or stored.request.id != wanted.proposal:
            raise ConfigurationError(f"there is no proposal {wanted.proposal}; propose it again")
        if stored.file_sha256 != text_hash(text):
            raise ConfigurationError("the configuration has been changed since the proposal; propose it again")
        checked = self._check(text, stored.request)
        kept = f"{path.name}.until-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
        begun = TrialJournal(
            id=wanted.id, by=wanted.by, reason=wanted.reason, before=text, after=checked.text, kept=kept
        )
        request.begin()
        said = {"proposed_by": stored.request.by, "proposed_reason": stored.request.reason}
        changes = [str(change) for change in checked.changes]
        self._note("applied", wanted, proposal=wanted.proposal, changes=changes, **said)
        before, after = (load_text(each, path.name, {}).alerts for each in (text, checked.text))
        note_change(self._data_dir, before, after)
        ConfigurationTrial(path).begin(begun)
        return {"text": f"on trial; the former one is kept: {path.with_name(kept)}"}

    def _check(self, text: str, wanted: ProposeConfiguration) -> CheckedProposal:
        checked = check_proposal(
            text, wanted.proposal, allow_network=wanted.allow_network, environment=self._environment
        )
        if self._service:
            require_sensor(load_text(checked.text, "proposal", self._environment), "proposal")
        return checked

    def _stored_proposal(self) -> StoredProposal | None:
        try:
            return StoredProposal.model_validate(parse_json(read_bounded(self._proposal_path)))
        except (OSError, ValueError):
            return None

    def _journal(self) -> TrialJournal | None:
        try:
            return None if self.trial is None else self.trial.journal()
        except (OSError, ValueError) as error:
            log.error("%s", error)
            return None

    def _note(self, event: str, what: Request | TrialJournal, **content: Any) -> None:
        """Write an entry of the audit. Raises `OSError`."""
        if self._audit is not None:
            now_utc = datetime.now(UTC).isoformat(timespec="seconds")
            self._audit.write(now_utc, event, id=what.id, by=what.by, reason=what.reason, **content)


class TrialSupervisor:
    """Confirms a configuration on trial or rolls it back, and ends the gateway for another one; time is an argument."""

    def __init__(
        self,
        changes: ConfigurationService,
        find_problem: Callable[[float], str | None],
        stopping: threading.Event,
        now_s: float,
    ) -> None:
        """`find_problem` returns why the gateway is not healthy at a time; None: it is."""
        self._changes = changes
        self._find_problem = find_problem
        self._stopping = stopping
        self._started_s = now_s
        self._healthy_since_s: float | None = None
        self._active = changes.on_trial

    def tick(self, now_s: float) -> None:
        """Judge the gateway; call a few times a second."""
        if self._active:
            try:
                self._judge(now_s, self._find_problem(now_s))
            except OSError as error:
                log.error("the trial of the configuration cannot be ended: %s", error)
        if self._changes.restart_wanted:
            self._stopping.set()

    def _judge(self, now_s: float, problem: str | None) -> None:
        if problem is not None:
            self._healthy_since_s = None
            if now_s - self._started_s >= DEADLINE_S:
                self._changes.roll_back(problem)
                self._active = False
            return
        if self._healthy_since_s is None:
            self._healthy_since_s = now_s
        if now_s - self._healthy_since_s >= HEALTHY_S:
            self._changes.confirm()
            self._active = False
