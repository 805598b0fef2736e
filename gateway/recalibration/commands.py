"""What each request would do, and why it must not: decided before anything is written."""

from collections.abc import Callable
from dataclasses import dataclass

from pydantic import ValidationError

from devices.block import DeviceInfo
from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.record_factory import make_record
from gateway.calibration.store import CalibrationStore
from gateway.errors import PlumblineError, describe_problems
from gateway.recalibration.interlock import LoadInterlock
from gateway.recalibration.methods import Methods
from gateway.recalibration.requests import Cancel, Commit, Recalibrate, Request, Rollback, Zero
from gateway.recalibration.sample_buffer import RecentSamples
from gateway.recalibration.session import Session
from gateway.recalibration.timestamp import Timestamp


class Refused(PlumblineError):  # noqa: N818  (not an error: the answer is no, and the text says why)
    """What was asked is not done."""


@dataclass(frozen=True, slots=True)
class Action:
    """What came of a request."""

    text: str
    session: Session | None
    record_id: str | None = None


ON_AGAIN = "alerts are on again: the housing must hang on the rope"
Act = Callable[[], Action]
"""Does what was planned. Raises `OSError` or `CalibrationError` where the disk does not let it."""


@dataclass(frozen=True, slots=True)
class CommandHandler:
    """Plans for one device."""

    device: DeviceInfo
    store: CalibrationStore
    methods: Methods
    watch: LoadInterlock
    readings: RecentSamples
    software: str

    def plan(self, request: Request, session: Session | None, moment: Timestamp) -> Act:
        """How to do what is asked. Raises `Refused` or `CalibrationError` where it must not be done."""
        active = session if session is not None and session.active else None
        match request:
            case Commit():
                return self._commit(request, active, moment)
            case Cancel():
                return self._cancel(request, session, moment)
        if active is not None:
            raise Refused(f"a session is under way ({active.method}, begun by {active.by}); cancel it first")
        match request:
            case Recalibrate():
                return self._session(request, moment)
            case Zero():
                return self._zero(request, moment)
            case Rollback():
                return self._rollback(request, session, moment)
        raise Refused(f"{type(request).__name__}: not known")

    def parent(self) -> CalibrationRecord | None:
        """What a new record follows: the record in force, else the factory's. One that cannot be read is nobody's parent."""
        try:
            stored = self.store.in_force()
        except CalibrationError:
            return None
        if stored is not None or self.device.factory_calibration is None:
            return stored
        return CalibrationRecord.model_validate(self.device.factory_calibration)

    def record(self, fit: CalibrationFit, *, by: str, request: str, moment: Timestamp) -> CalibrationRecord:
        """The record of a fit. Raises `CalibrationError`."""
        parent = self.parent()
        try:
            return make_record(
                fit,
                device_id=self.device.device_id,
                unit=self.device.unit,
                software=self.software,
                by=by,
                created_utc=moment.utc,
                parent=None if parent is None else parent.id,
                request=request,
            )
        except ValidationError as error:
            raise CalibrationError(f"the fit is no record: {describe_problems(error)[0]}") from error

    def _session(self, request: Recalibrate, moment: Timestamp) -> Act:
        why = self.watch.recalibration_refusal(confirmed=request.housing_off_rope, now_ns=moment.time_ns)
        if why is not None:
            raise Refused(why)
        parent = self.parent()
        session = Session(
            id=request.id,
            phase="collecting",
            method=request.method,
            by=request.by,
            device_id=self.device.device_id,
            parent=None if parent is None else parent.id,
            begun_ns=moment.time_ns,
            touched_ns=moment.time_ns,
        )
        return lambda: Action("collecting; swing alerts are suspended until the session ends", session)

    def _zero(self, request: Zero, moment: Timestamp) -> Act:
        parent = self.parent()
        if parent is None:
            raise Refused("no calibration is in force that could be zeroed; recalibrate first")
        if (why := self.watch.zeroing_refusal()) is not None:
            raise Refused(why)
        fit = self.methods.zero(self.readings.recent(), parent, self.device)
        record = self.record(fit, by=request.by, request=request.id, moment=moment)
        if (why := self.methods.judge(fit, parent).refusal(request.reason)) is not None:
            raise Refused(why)
        session = Session(
            id=request.id,
            phase="committed",
            method=record.method,
            by=request.by,
            device_id=self.device.device_id,
            parent=parent.id,
            begun_ns=moment.time_ns,
            touched_ns=moment.time_ns,
            candidate=record.model_dump(mode="json"),
            text=f"record {record.id} is in force",
        )
        return lambda: self._put_in_force(record, session, request, moment)

    def _commit(self, request: Commit, session: Session | None, moment: Timestamp) -> Act:
        if session is None or session.candidate is None or session.judgement is None:
            raise Refused("no record is in review" if session is None else "the session is still collecting poses")
        if request.record is not None and request.record != session.record_id:
            raise Refused(f"record {session.record_id} is in review, not {request.record}")
        if (why := session.judgement.refusal(request.reason)) is not None:
            raise Refused(why)
        record = CalibrationRecord.model_validate(session.candidate)
        ended = session.ended("committed", f"record {record.id} is in force", moment.time_ns, left=False)
        return lambda: self._put_in_force(record, ended, request, moment)

    def _rollback(self, request: Rollback, session: Session | None, moment: Timestamp) -> Act:
        now = self.store.state().in_force
        target = request.to if request.to is not None else self._parent_of(now)
        if target == now:
            raise Refused(f"record {now} is in force already")
        if target is not None:
            self.store.record(target)
        said = "the device's factory record, or none," if target is None else f"record {target}"

        def act() -> Action:
            self._change(target, request, moment)
            return Action(f"{said} is in force again", session, target)

        return act

    def _parent_of(self, record_id: str | None) -> str | None:
        if record_id is None:
            raise Refused("no record is in force that could be rolled back; name one with to")
        parent = self.store.record(record_id).parent
        factory = self.device.factory_calibration
        if parent is None or parent in self.store.ids():
            return parent
        if factory is not None and factory.get("id") == parent:
            return None
        raise Refused(f"parent {parent} of record {record_id} is not in the store; name another with to")

    def _cancel(self, request: Cancel, session: Session | None, moment: Timestamp) -> Act:
        if session is not None and session.left:
            confirmed = session.model_copy(update={"left": False})
            return lambda: Action("alerts are on again: the housing hangs on the rope", confirmed)
        if session is None or not session.active:
            raise Refused("no session is under way")
        ended = session.ended("rejected", f"cancelled by {request.by}", moment.time_ns, left=False)
        return lambda: Action(f"{ended.text}; {ON_AGAIN}", ended)

    def _put_in_force(self, record: CalibrationRecord, ended: Session, request: Request, moment: Timestamp) -> Action:
        self.store.add(record)
        self._change(record.id, request, moment)
        return Action(f"record {record.id} is in force; {ON_AGAIN}", ended, record.id)

    def _change(self, record_id: str | None, request: Request, moment: Timestamp) -> None:
        """Raises `OSError` where nothing has changed."""
        try:
            self.store.put_in_force(
                record_id, by=request.by, reason=request.reason, request=request.id, time_utc=moment.utc
            )
        except OSError:
            if self.store.state().in_force != record_id:
                raise  # else only the last sync failed: what a restart would find is what was asked for
