"""Requests in, answers and a session out: what is asked is checked, written down, done, and remembered.

The order on the disk makes a kill harmless at any point: the audit entry, the record, the id in force, the journal. What was
in force stays so until one rename; what a restart finds half done is either finished (the new record is in force) or goes on.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.methods.zeroing import MIN_REST_S
from gateway.calibration.procedures.pose_procedure import PoseProcedure, PoseProgress
from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.errors import PlumblineError
from gateway.recalibration import requests
from gateway.recalibration.audit import Audit
from gateway.recalibration.commands import Action, CommandHandler
from gateway.recalibration.fetch_handler import read_store
from gateway.recalibration.interlock import LoadInterlock
from gateway.recalibration.journal import MOST_ANSWERS, Answer, Journal
from gateway.recalibration.methods import Methods
from gateway.recalibration.requests import Request
from gateway.recalibration.sample_buffer import RecentSamples
from gateway.recalibration.session import Session
from gateway.recalibration.timestamp import Timestamp

MARGIN_S = 1.0
"""Readings are kept for this much longer than zeroing needs."""


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to a request, and whether the request has changed what the pipeline computes with."""

    answer: Answer
    pipeline_changed: bool = False


class Recalibration:
    """The sessions of a gateway. Whoever owns it feeds it blocks and requests, and tells it the time."""

    def __init__(self, data_dir: Path, methods: Methods, *, software: str, tell: Callable[[str], None]) -> None:
        """`tell` writes a line to the log. Nothing can be asked before `open`."""
        folder = data_dir / "calibration"
        self._data_dir = data_dir
        self._methods = methods
        self._software = software
        self._tell = tell
        self._journal = Journal(folder / "session.json")
        self._audit = Audit(folder / "audit.jsonl", tell)
        self._readings = RecentSamples(MIN_REST_S + MARGIN_S)
        self._procedure: PoseProcedure | None = None
        self._progress: PoseProgress | None = None
        self._planner: CommandHandler | None = None
        self.session = self._journal.session
        """The last session, active or ended."""
        self.watch = LoadInterlock()

    def open(self, device: DeviceInfo, moment: Timestamp) -> None:
        """A device has been opened, at start or again: an unfinished session goes on with it, or ends."""
        store = CalibrationStore(self._data_dir, device.device_id)
        self._planner = CommandHandler(device, store, self._methods, self.watch, self._readings, self._software)
        self._readings.forget()
        self.watch.forget()
        self._procedure = self._progress = None
        if self._journal.complaint is not None:
            self._write_audit(moment, "journal", text=self._journal.complaint)
            self.session = _unknown(device.device_id, self._journal.complaint, moment)
            self._journal.complaint = None
        session = self.session
        if session is None or not session.active:
            return
        if session.device_id != device.device_id:
            self._end("rejected", f"the sensor was exchanged: {device.device_id} took its place", moment)
        elif session.record_id is not None and _id_in_force(store) == session.record_id:
            self._end("committed", f"record {session.record_id} is in force", moment)
        elif (why := session.lost_by_restart(moment.time_ns)) is not None:
            self._end("rejected", why, moment)
        else:
            self._write_audit(moment, "resumed", session=session.id, phase=session.phase, poses=len(session.poses))
            self._keep(session.resumed(), moment)
            self._resume(self.session)

    @property
    def progress(self) -> PoseProgress | None:
        """Of the procedure under way."""
        return self._progress

    @property
    def suspended(self) -> str | None:
        """Why the alerts are suspended; None: they are not."""
        return None if self.session is None else self.session.suspends

    def feed(self, block: SampleBlock, moment: Timestamp) -> bool:
        """Take a block of raw samples; return whether that has ended the session."""
        readings = self._readings.take(block)
        if self._procedure is None or self.session is None:
            return False
        self._procedure.feed(readings)
        self._progress = progress = self._procedure.progress()
        if progress.poses != self.session.poses:
            self._keep(self.session.with_poses(progress.poses, moment.time_ns), moment)
        if progress.complete and self._procedure is not None:
            self._review(self._procedure, moment)
        return not self.session.active

    def tick(self, moment: Timestamp) -> bool:
        """End a session that has lasted too long; return whether it has ended."""
        if self.session is None or (why := self.session.timed_out(moment.time_ns)) is None:
            return False
        self._end("rejected", why, moment)
        return True

    def answer(self, verb: str, payload: bytes, moment: Timestamp) -> Response:
        """Do what is asked, or say why not. The same request has the same answer, and is done once."""
        if verb == "fetch":
            return Response(read_store(payload, self._opened.store, self._audit, self.session))
        try:
            request = requests.parse_request(verb, payload)
        except requests.RequestError as error:
            self._write_audit(moment, "request", verb=verb, accepted=False, why=str(error))
            return Response(Answer(id="", request="", accepted=False, text=str(error)))
        fingerprint = f"{verb} {request.model_dump_json()}"
        known = self._journal.answer(request.id) or self._done_before(request, fingerprint)
        if known is None:
            return self._decide(verb, request, fingerprint, moment)
        if known.request == fingerprint:
            return Response(known)
        text = f"id {request.id} is that of another request; choose a new one"
        return Response(Answer(id=request.id, request=fingerprint, accepted=False, text=text))

    def _decide(self, verb: str, request: Request, fingerprint: str, moment: Timestamp) -> Response:
        asked = {"verb": verb, **request.model_dump(mode="json")}
        try:
            act = self._opened.plan(request, self.session, moment)
        except (PlumblineError, ValueError, ArithmeticError) as refusal:
            self._write_audit(moment, "request", **asked, accepted=False, why=str(refusal))
            answer = Answer(id=request.id, request=fingerprint, accepted=False, text=str(refusal))
            self._save(self.session, answer)
            return Response(answer)
        try:
            self._audit.write(moment.utc, "request", **asked, accepted=True)
            outcome = act()
        except (OSError, CalibrationError) as error:
            self._write_audit(moment, "failed", id=request.id, text=str(error))
            return Response(
                Answer(id=request.id, request=fingerprint, accepted=False, text=f"could not be done: {error}")
            )
        content = {} if outcome.record_id is None else {"record": outcome.record_id}
        answer = Answer(id=request.id, request=fingerprint, accepted=True, text=outcome.text, content=content)
        return self._take(outcome, answer, moment)

    def _take(self, outcome: Action, answer: Answer, moment: Timestamp) -> Response:
        """Keep what came of a request and its answer in one step."""
        begins = outcome.session is not None and outcome.session.active
        if not self._save(outcome.session, answer) and begins:
            return Response(
                answer.model_copy(update={"accepted": False, "text": "the session cannot be kept on the disk"})
            )
        self.session = outcome.session
        self._procedure = self._progress = None
        self._resume(outcome.session)
        self.watch.forget()
        self._write_audit(moment, "done", id=answer.id, text=answer.text)
        return Response(answer, pipeline_changed=True)

    def _resume(self, session: Session | None) -> None:
        if session is None or session.phase != "collecting":
            return
        planner = self._opened
        self._procedure = self._methods.procedure(session.method, planner.device, planner.parent())
        self._procedure.resume(session.poses)
        self._progress = self._procedure.progress()

    def _review(self, procedure: PoseProcedure, moment: Timestamp) -> None:
        """All poses are there: the fit, the record and the judge's word on it."""
        session = self.session
        assert session is not None
        try:
            fit = procedure.finish()
            record = self._opened.record(fit, by=session.by, request=session.id, moment=moment)
            judgement = self._methods.judge(fit, self._opened.parent())
        except (ValueError, ArithmeticError) as error:  # of numbers that nobody thought of, too: no restart mends them
            self._end("rejected", str(error), moment)
            return
        self._procedure = self._progress = None
        self._keep(session.reviewed(record.model_dump(mode="json"), judgement, moment.time_ns), moment)
        self._write_audit(moment, "review", session=session.id, record=record.id, **judgement.model_dump(mode="json"))

    def _keep(self, session: Session, moment: Timestamp) -> None:
        """A session that a restart could not go on with does not go on now."""
        if self._save(session):
            self.session = session
        else:
            self._end("rejected", "the session cannot be kept on the disk", moment)

    def _end(self, phase: Literal["committed", "rejected"], text: str, moment: Timestamp) -> None:
        assert self.session is not None
        self.session = self.session.ended(phase, text, moment.time_ns, left=phase == "rejected")
        self._procedure = self._progress = None
        self._save(self.session)
        self.watch.forget()
        self._write_audit(moment, phase, session=self.session.id, text=text)

    def _done_before(self, request: Request, fingerprint: str) -> Answer | None:
        """The answer to a request that was done, and a kill came before the answer was kept."""
        begins = isinstance(request, requests.Recalibrate | requests.Zero)
        if begins and self.session is not None and self.session.id == request.id:
            return Answer(id=request.id, request=fingerprint, accepted=True, text=f"session {self.session.phase}")
        try:
            history = self._opened.store.state().history[-MOST_ANSWERS:]
        except CalibrationError:
            return None
        for change in history:
            if change.request == request.id:
                content = {} if change.after is None else {"record": change.after}
                text = f"done at {change.time_utc}: in force since is {change.after or 'no record of the store'}"
                return Answer(id=request.id, request=fingerprint, accepted=True, text=text, content=content)
        return None

    def _save(self, session: Session | None, answer: Answer | None = None) -> bool:
        try:
            self._journal.save(session, answer)
        except OSError as error:
            self._tell(f"the session's journal cannot be written: {error}")
            return False
        return True

    def _write_audit(self, moment: Timestamp, event: str, **content: object) -> None:
        """An audit entry of what is so anyway: where it cannot be kept, the log has it."""
        try:
            self._audit.write(moment.utc, event, **content)
        except OSError as error:
            self._tell(f"the audit cannot be written: {error}")

    @property
    def _opened(self) -> CommandHandler:
        if self._planner is None:
            raise ValueError("no device has been opened yet")
        return self._planner


def _unknown(device_id: str, complaint: str, moment: Timestamp) -> Session:
    """Whether a session was under way is not known: as if one had been left."""
    return Session(
        id="unknown",
        phase="rejected",
        method="",
        by="",
        device_id=device_id,
        parent=None,
        begun_ns=moment.time_ns,
        touched_ns=moment.time_ns,
        text=complaint,
        left=True,
    )


def _id_in_force(store: CalibrationStore) -> str | None:
    try:
        return store.state().in_force
    except CalibrationError:
        return None
