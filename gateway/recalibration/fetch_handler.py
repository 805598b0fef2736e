"""What can be fetched: the records, one of them, the audit. Nothing is changed by it."""

from typing import Any

from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.recalibration.audit import Audit
from gateway.recalibration.journal import Answer
from gateway.recalibration.requests import RequestError, parse_fetch
from gateway.recalibration.session import Session

SHOWN = {"id", "method", "created_utc", "by", "parent"}


def read_store(payload: bytes, store: CalibrationStore, audit: Audit, session: Session | None) -> Answer:
    """The answer to a request for what is stored, or in review."""
    reviewed = session if session is not None and session.phase == "review" else None
    try:
        wanted = parse_fetch(payload)
        if wanted.what == "audit":
            content: dict[str, Any] = {"audit": audit.newest(wanted.lines)}
        elif wanted.what == "record":
            content = {"record": _record(wanted.record or "", store, reviewed)}
        else:
            content = _list(store) | {"review": None if reviewed is None else reviewed.record_id}
    except (RequestError, CalibrationError, OSError) as error:
        return Answer(id="", request="", accepted=False, text=str(error))
    return Answer(id="", request="", accepted=True, text=wanted.what, content=content)


def _record(record_id: str, store: CalibrationStore, reviewed: Session | None) -> dict[str, Any]:
    if reviewed is not None and reviewed.candidate is not None and reviewed.record_id == record_id:
        return reviewed.candidate
    return store.record(record_id).model_dump(mode="json")


def _list(store: CalibrationStore) -> dict[str, Any]:
    """Every record in a line, a spoilt one by what is wrong with it."""
    records: list[dict[str, Any]] = []
    for record_id in store.ids():
        try:
            records.append(store.record(record_id).model_dump(mode="json", include=SHOWN))
        except CalibrationError as error:
            records.append({"id": record_id, "error": str(error)})
    state = store.state()
    history = [change.model_dump(mode="json", by_alias=True) for change in state.history]
    return {"device_id": store.device_id, "in_force": state.in_force, "history": history, "records": records}
