"""Commands: what each request would do, or why it is refused, decided before anything is written; and what is fetched."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from devices.axes_map import AxesMap
from devices.block import DeviceInfo
from gateway.calibration.acceptance import judge, make_record
from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.correction import housing_rotation
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import CalibrationStore
from gateway.errors import PlumblineError, describe_problems
from gateway.recalibration.interlock import LoadInterlock, RecentSamples
from gateway.recalibration.journal import Audit
from gateway.recalibration.requests import Cancel, Commit, Fetch, Recalibrate, Request, RequestAnswer, Rollback, Zero
from gateway.recalibration.session import Session, Timestamp, committed_text, withdrawn_text

ALERTS_RESUMED = "alerts are on again: the housing must hang on the rope"
LISTED_FIELDS = {"id", "method", "created_utc", "by", "parent"}
"""Fields of a record in the list."""


class Refused(PlumblineError):  # noqa: N818  (not an error: the answer is no, and the text states why)
    """A request is refused; the text states the reason."""


@dataclass(frozen=True, slots=True)
class CommandResult:
    """Result of an executed command."""

    text: str
    session: Session | None
    """The session afterwards."""
    record_id: str | None = None
    """Id of the record that the command has put in force."""


Command = Callable[[], CommandResult]
"""Executes what was decided. Raises `OSError` or `CalibrationError` if the disk does not allow it."""


@dataclass(frozen=True, slots=True)
class CommandHandler:
    """Makes the commands of one device."""

    device: DeviceInfo
    store: CalibrationStore
    axes: AxesMap
    interlock: LoadInterlock
    recent_samples: RecentSamples
    software: str

    def prepare(self, request: Request, session: Session | None, now: Timestamp) -> Command:
        """Return the command of a request. Raises `Refused` or `CalibrationError` if it must not be executed."""
        active = session if session is not None and session.is_active else None
        match request:
            case Commit():
                return self._prepare_commit(request, active, now)
            case Cancel():
                return self._prepare_cancel(request, session, now)
        if active is not None:
            raise Refused(f"a session is active ({active.method}, started by {active.by}); cancel it first")
        match request:
            case Recalibrate():
                return self._prepare_session(request, now)
            case Zero():
                return self._prepare_zero(request, now)
            case Rollback():
                return self._prepare_rollback(request, session, now)
        raise Refused(f"{type(request).__name__}: not known")

    def parent(self) -> CalibrationRecord | None:
        """Return the parent of a new record: the record in force, or the factory record; None if it must not be used."""
        try:
            stored = self.store.in_force()
        except CalibrationError:
            return None
        if stored is not None or self.device.factory_calibration is None:
            return stored
        return CalibrationRecord.model_validate(self.device.factory_calibration)

    def record_of(
        self, fit: CalibrationFit, parent: CalibrationRecord | None, *, by: str, request: str, now: Timestamp
    ) -> CalibrationRecord:
        """Return the record of a fit. Raises `CalibrationError`."""
        try:
            return make_record(
                fit,
                device_id=self.device.device_id,
                unit=self.device.unit,
                software=self.software,
                by=by,
                created_utc=now.utc,
                parent=None if parent is None else parent.id,
                request=request,
            )
        except ValidationError as error:
            raise CalibrationError(f"the fit is no valid record: {describe_problems(error)[0]}") from error

    def _prepare_session(self, request: Recalibrate, now: Timestamp) -> Command:
        reason = self.interlock.recalibration_refusal(confirmed=request.housing_off_rope, now_ns=now.time_ns)
        if reason is not None:
            raise Refused(reason)
        parent = self.parent()
        session = Session(
            id=request.id,
            phase="collecting",
            method=request.method.value,
            by=request.by,
            device_id=self.device.device_id,
            parent=None if parent is None else parent.id,
            begun_ns=now.time_ns,
            touched_ns=now.time_ns,
        )
        return lambda: CommandResult("collecting; swing alerts are suspended until the session ends", session)

    def _prepare_zero(self, request: Zero, now: Timestamp) -> Command:
        from gateway.calibration.methods.zeroing import zero_in_place

        parent = self.parent()
        if parent is None:
            raise Refused("no calibration is in force that could be zeroed; recalibrate first")
        if (reason := self.interlock.zeroing_refusal()) is not None:
            raise Refused(reason)
        rotation = housing_rotation(self.axes)
        fit = zero_in_place(self.recent_samples.recent(), parent, rotation, self.device.units_per_g)
        record = self.record_of(fit, parent, by=request.by, request=request.id, now=now)
        if (reason := judge(fit, parent).refusal(request.reason)) is not None:
            raise Refused(reason)
        session = Session(
            id=request.id,
            phase="committed",
            method=record.method,
            by=request.by,
            device_id=self.device.device_id,
            parent=parent.id,
            begun_ns=now.time_ns,
            touched_ns=now.time_ns,
            candidate=record.model_dump(mode="json"),
            text=committed_text(record.id),
        )
        return lambda: self._put_in_force(record, session, request, now)

    def _prepare_commit(self, request: Commit, session: Session | None, now: Timestamp) -> Command:
        if session is None or session.candidate is None or session.judgement is None:
            raise Refused("no record is in review" if session is None else "the session is still collecting poses")
        if request.record is not None and request.record != session.record_id:
            raise Refused(f"record {session.record_id} is in review, not {request.record}")
        if (reason := session.judgement.refusal(request.reason)) is not None:
            raise Refused(reason)
        record = CalibrationRecord.model_validate(session.candidate)
        ended = session.end("committed", committed_text(record.id), now.time_ns, left=False)
        return lambda: self._put_in_force(record, ended, request, now)

    def _prepare_rollback(self, request: Rollback, session: Session | None, now: Timestamp) -> Command:
        in_force = self.store.state().in_force
        target = request.to if request.to is not None else self._parent_of(in_force)
        factory = self.device.factory_calibration
        if factory is not None and target == factory.get("id") and target not in self.store.ids():
            target = None
        if target == in_force:
            raise Refused(f"record {request.to or in_force} is in force already")
        if target is not None:
            self.store.record(target)

        def roll_back() -> CommandResult:
            self._change_in_force(target, request, now)
            after = _after_rollback(session, self.store.device_id, target, request)
            return CommandResult(self._in_force_again(target), after, target)

        return roll_back

    def _in_force_again(self, target: str | None) -> str:
        if target is not None:
            return f"record {target} is in force again"
        factory = self.device.factory_calibration
        if factory is None:
            return "no record is in force: the device has none of its factory"
        return f"the device's factory record {factory.get('id')} is in force again"

    def _parent_of(self, record_id: str | None) -> str | None:
        if record_id is None:
            raise Refused("no record is in force that could be rolled back; name the one that shall be in force (--to)")
        parent = self.store.record(record_id).parent
        factory = self.device.factory_calibration
        if parent is None or parent in self.store.ids():
            return parent
        if factory is not None and factory.get("id") == parent:
            return None
        raise Refused(f"parent {parent} of record {record_id} is not in the store; name another with to")

    def _prepare_cancel(self, request: Cancel, session: Session | None, now: Timestamp) -> Command:
        if session is not None and session.left:
            confirmed = session.model_copy(update={"left": False})
            return lambda: CommandResult("alerts are on again: the housing hangs on the rope", confirmed)
        if session is None or not session.is_active:
            raise Refused("no session is active")
        ended = session.end("rejected", f"cancelled by {request.by}", now.time_ns, left=False)
        return lambda: CommandResult(f"{ended.text}; {ALERTS_RESUMED}", ended)

    def _put_in_force(
        self, record: CalibrationRecord, ended: Session, request: Request, now: Timestamp
    ) -> CommandResult:
        self.store.add(record)
        self._change_in_force(record.id, request, now)
        return CommandResult(f"record {record.id} is in force; {ALERTS_RESUMED}", ended, record.id)

    def _change_in_force(self, record_id: str | None, request: Request, now: Timestamp) -> None:
        """Raises `OSError` if nothing has changed."""
        self.store.put_in_force(record_id, by=request.by, reason=request.reason, request=request.id, time_utc=now.utc)


def _after_rollback(session: Session | None, device_id: str, target: str | None, request: Rollback) -> Session | None:
    """Return the last session with what has become of its record."""
    if session is None or session.phase != "committed" or session.device_id != device_id:
        return session
    text = committed_text(target) if session.record_id == target else None
    if text is None and session.text == committed_text(session.record_id):
        text = withdrawn_text(session.record_id, request.by, request.reason)
    return session.model_copy(update={"text": text or session.text})


def answer_fetch(fetch: Fetch, store: CalibrationStore, audit: Audit, session: Session | None) -> RequestAnswer:
    """Return the answer to a fetch request for what is stored or in review."""
    reviewed = session if session is not None and session.phase == "review" else None
    try:
        if fetch.what == "audit":
            content: dict[str, Any] = {"audit": audit.newest(fetch.lines)}
        elif fetch.what == "record":
            content = {"record": _find_record(fetch.record or "", store, reviewed)}
        else:
            content = _list_records(store) | {"review": None if reviewed is None else reviewed.record_id}
    except (CalibrationError, OSError) as error:
        return RequestAnswer(id="", request="", accepted=False, text=str(error))
    return RequestAnswer(id="", request="", accepted=True, text=fetch.what, content=content)


def _find_record(record_id: str, store: CalibrationStore, reviewed: Session | None) -> dict[str, Any]:
    if reviewed is not None and reviewed.candidate is not None and reviewed.record_id == record_id:
        return reviewed.candidate
    return store.record(record_id).model_dump(mode="json")


def _list_records(store: CalibrationStore) -> dict[str, Any]:
    """Return an entry for each record; the entry of an unreadable record states the error."""
    records: list[dict[str, Any]] = []
    for record_id in store.ids():
        try:
            records.append(store.record(record_id).model_dump(mode="json", include=LISTED_FIELDS))
        except CalibrationError as error:
            records.append({"id": record_id, "error": str(error)})
    state = store.state()
    history = [change.model_dump(mode="json", by_alias=True) for change in state.history]
    return {"device_id": store.device_id, "in_force": state.in_force, "history": history, "records": records}
