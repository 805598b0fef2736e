"""The recalibration of a gateway: requests in, answers and a session out.

A request is validated, decided, audited, executed and remembered. The order of writing makes a kill harmless at any point: audit
entry, record, id in force, journal. The record in force stays until one rename. An unfinished command is completed by the restart
if the new record is in force; otherwise the session continues.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from devices.axes_map import AxesMap
from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.acceptance import judge
from gateway.calibration.pose import MIN_UNBROKEN_REST_S, NominalSensitivity
from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.errors import PlumblineError
from gateway.recalibration.commands import CommandHandler, CommandResult, answer_fetch
from gateway.recalibration.interlock import LoadInterlock, RecentSamples
from gateway.recalibration.journal import MAX_ANSWERS, Audit, Journal
from gateway.recalibration.requests import Fetch, Recalibrate, Request, RequestAnswer, Zero
from gateway.recalibration.session import Session, Timestamp, abandoned_session, committed_text

if TYPE_CHECKING:
    from gateway.calibration.pose_procedure import PoseProcedure, PoseProgress

BUFFER_MARGIN_S = 1.0
"""Duration of the readings that are kept beyond what zeroing needs, s. Basis: a choice; some blocks, so that a full rest is
always within."""
NOT_SAVED = "the session cannot be saved on the disk"


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to a request."""

    answer: RequestAnswer
    pipeline_changed: bool = False
    """Whether the request has changed the correction or the suspension, so that the pipeline must be opened again."""


class Recalibration:
    """The sessions of one gateway. Its owner feeds it blocks, requests and the time."""

    def __init__(
        self,
        data_dir: Path,
        axes: AxesMap,
        *,
        software: str,
        log_line: Callable[[str], None],
    ) -> None:
        """`log_line` writes a line to the log. No request can be answered before `open`."""
        folder = data_dir / "calibration"
        self._data_dir = data_dir
        self._axes = axes
        self._software = software
        self._log_line = log_line
        self._journal = Journal(folder / "session.json")
        self._audit = Audit(folder / "audit.jsonl", log_line)
        self._recent_samples = RecentSamples(MIN_UNBROKEN_REST_S + BUFFER_MARGIN_S)
        self._procedure: PoseProcedure | None = None
        self._progress: PoseProgress | None = None
        self._handler: CommandHandler | None = None
        self.session = self._journal.session
        """The last session, active or ended."""
        self.interlock = LoadInterlock()

    def open(self, device: DeviceInfo, now: Timestamp) -> None:
        """Start with an opened device: an unfinished session continues with it, or ends."""
        self._handler = CommandHandler(
            device=device,
            store=CalibrationStore(self._data_dir, device.device_id),
            axes=self._axes,
            interlock=self.interlock,
            recent_samples=self._recent_samples,
            software=self._software,
        )
        self._recent_samples.clear()
        self.interlock.clear()
        self._procedure = self._progress = None
        if self._journal.read_error is not None:
            self._try_audit(now, "journal", text=self._journal.read_error)
            self.session = abandoned_session(device.device_id, self._journal.read_error, now)
            self._journal.read_error = None
        session = self.session
        if session is None or not session.is_active:
            return
        if session.device_id != device.device_id:
            self._end(session, "rejected", f"the sensor was exchanged for {device.device_id}", now)
        elif session.record_id is not None and _id_in_force(self._opened.store) == session.record_id:
            self._end(session, "committed", committed_text(session.record_id), now)
        elif (reason := session.restart_refusal(now.time_ns)) is not None:
            self._end(session, "rejected", reason, now)
        else:
            self._try_audit(now, "resumed", session=session.id, phase=session.phase, poses=len(session.poses))
            self._save_or_end(session.resume(), now)
            try:
                self._start_procedure(self._make_procedure(self.session))
            except (PlumblineError, ValueError, ArithmeticError) as error:  # of whatever the journal contained
                self._end(session, "rejected", f"the session cannot continue: {error}", now)

    @property
    def progress(self) -> "PoseProgress | None":
        """Progress of the active procedure."""
        return self._progress

    def feed(self, block: SampleBlock, now: Timestamp) -> bool:
        """Process a block of raw samples; return whether it has ended the session."""
        readings = self._recent_samples.add(block)
        if self._procedure is None or self.session is None:
            return False
        self._procedure.feed(readings)
        self._progress = progress = self._procedure.progress()
        if progress.poses != self.session.poses:
            self._save_or_end(self.session.with_poses(progress.poses, now.time_ns), now)
        if progress.complete and self._procedure is not None:
            self._review(self.session, self._procedure, now)
        return not self.session.is_active

    def tick(self, now: Timestamp) -> bool:
        """End a session that has lasted too long; return whether it has ended."""
        if self.session is None or (reason := self.session.timeout_reason(now.time_ns)) is None:
            return False
        self._end(self.session, "rejected", reason, now)
        return True

    def fetch(self, fetch: Fetch) -> RequestAnswer:
        """Return what is stored or in review. It changes nothing, and any thread may call it."""
        return answer_fetch(fetch, self._opened.store, self._audit, self.session)

    def answer(self, verb: str, request: Request, now: Timestamp, begin: Callable[[], None] = lambda: None) -> Response:
        """Execute a request or refuse it. The same request has the same answer, and is executed once.

        `begin` is called between the decision and the first change; it raises `TimeoutError` where that took too long.
        """
        fingerprint = f"{verb} {request.model_dump_json()}"
        try:
            known = self._journal.answer(request.id) or self._find_executed(request, fingerprint)
            if known is None:
                return self._execute(verb, request, fingerprint, now, begin)
        except (OSError, CalibrationError) as error:  # not kept, so that the same request may be sent again
            self._try_audit(now, "failed", id=request.id, text=str(error))
            text = f"could not be executed: {error}"
            return Response(RequestAnswer(id=request.id, request=fingerprint, accepted=False, text=text))
        if known.request == fingerprint:
            return Response(known)
        text = f"id {request.id} is that of another request; choose a new one"
        return Response(RequestAnswer(id=request.id, request=fingerprint, accepted=False, text=text))

    def _execute(
        self, verb: str, request: Request, fingerprint: str, now: Timestamp, begin: Callable[[], None]
    ) -> Response:
        """Execute a request or refuse it. Raises `OSError` or `CalibrationError` if the disk does not allow it."""
        audited = {"verb": verb, **request.model_dump(mode="json")}
        try:
            command = self._opened.prepare(request, self.session, now)
        except (PlumblineError, ValueError, ArithmeticError) as refusal:
            answer = RequestAnswer(id=request.id, request=fingerprint, accepted=False, text=str(refusal))
            # A refusal has changed nothing: it is kept without waiting for the disk, so that a flood of them delays nothing.
            self._journal.remember(answer)
            self._try_audit(now, "request", durable=False, **audited, accepted=False, why=answer.text)
            return Response(answer)
        begin()
        self._audit.write(now.utc, "request", **audited, accepted=True)
        result = command()
        procedure = self._make_procedure(result.session)
        content = {} if result.record_id is None else {"record": result.record_id}
        answer = RequestAnswer(id=request.id, request=fingerprint, accepted=True, text=result.text, content=content)
        return self._save_result(result, procedure, answer, now)

    def _save_result(
        self, result: CommandResult, procedure: "PoseProcedure | None", answer: RequestAnswer, now: Timestamp
    ) -> Response:
        """Save the result of a command and its answer in one step."""
        starts_session = result.session is not None and result.session.is_active
        if not self._try_save(result.session, answer) and starts_session:
            return Response(answer.model_copy(update={"accepted": False, "text": NOT_SAVED}))
        self.session = result.session
        self._start_procedure(procedure)
        self.interlock.clear()
        self._try_audit(now, "done", id=answer.id, text=answer.text)
        return Response(answer, pipeline_changed=True)

    def _make_procedure(self, session: Session | None) -> "PoseProcedure | None":
        """Return the procedure of a session that collects poses."""
        if session is None or session.phase != "collecting":
            return None
        from gateway.calibration.pose_procedure import make_procedure

        device = self._opened.device
        nominal, parent = NominalSensitivity(device.units_per_g), self._opened.parent()
        procedure = make_procedure(session.method, nominal, parent=parent)
        procedure.resume(session.poses)
        return procedure

    def _start_procedure(self, procedure: "PoseProcedure | None") -> None:
        self._procedure = procedure
        self._progress = None if procedure is None else procedure.progress()

    def _review(self, session: Session, procedure: "PoseProcedure", now: Timestamp) -> None:
        """Fit the complete poses, make the record, and judge it."""
        parent = self._opened.parent()
        try:
            fit = procedure.finish()
            record = self._opened.record_of(fit, parent, by=session.by, request=session.id, now=now)
            acceptance = judge(fit, parent)
        except (ValueError, ArithmeticError) as error:  # of unforeseen numbers as well: a restart would not help
            self._end(session, "rejected", str(error), now)
            return
        self._procedure = self._progress = None
        self._save_or_end(session.start_review(record.model_dump(mode="json"), acceptance, now.time_ns), now)
        self._try_audit(now, "review", session=session.id, record=record.id, **acceptance.model_dump(mode="json"))

    def _save_or_end(self, session: Session, now: Timestamp) -> None:
        """Save a session, or end the old one: a restart could not continue it."""
        if self._try_save(session):
            self.session = session
        elif self.session is not None:
            self._end(self.session, "rejected", NOT_SAVED, now)

    def _end(self, session: Session, phase: Literal["committed", "rejected"], text: str, now: Timestamp) -> None:
        self.session = session.end(phase, text, now.time_ns, left=phase == "rejected")
        self._procedure = self._progress = None
        self._try_save(self.session)
        self.interlock.clear()
        self._try_audit(now, phase, session=session.id, text=text)

    def _find_executed(self, request: Request, fingerprint: str) -> RequestAnswer | None:
        """Return the answer to a request that was executed before a kill, whose answer was not saved."""
        starts_session = isinstance(request, Recalibrate | Zero)
        if starts_session and self.session is not None and self.session.id == request.id:
            text = f"session {self.session.phase}"
            return RequestAnswer(id=request.id, request=fingerprint, accepted=True, text=text)
        try:
            history = self._opened.store.state().history[-MAX_ANSWERS:]
        except CalibrationError:
            return None
        for change in history:
            if change.request == request.id:
                content = {} if change.after is None else {"record": change.after}
                text = f"executed at {change.time_utc}; it has put in force {change.after or 'no record of the store'}"
                return RequestAnswer(id=request.id, request=fingerprint, accepted=True, text=text, content=content)
        return None

    def _try_save(self, session: Session | None, answer: RequestAnswer | None = None) -> bool:
        try:
            self._journal.save(session, answer)
        except OSError as error:
            self._log_line(f"the session's journal cannot be written: {error}")
            return False
        return True

    def _try_audit(self, now: Timestamp, event: str, *, durable: bool = True, **content: Any) -> None:
        """Audit what has happened in any case; if the audit cannot be written, the log contains it."""
        try:
            self._audit.write(now.utc, event, durable=durable, **content)
        except OSError as error:
            self._log_line(f"the audit cannot be written: {error}")

    @property
    def _opened(self) -> CommandHandler:
        if self._handler is None:
            raise ValueError("no device has been opened yet")
        return self._handler


def _id_in_force(store: CalibrationStore) -> str | None:
    try:
        return store.state().in_force
    except CalibrationError:
        return None
