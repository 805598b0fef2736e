"""Answers fetch requests: the list of records, one record, or the audit. It changes nothing."""

from typing import Any

from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.recalibration.journal import Audit
from gateway.recalibration.requests import Fetch, RequestAnswer
from gateway.recalibration.session import Session

LISTED_FIELDS = {"id", "method", "created_utc", "by", "parent"}
"""Fields of a record in the list."""


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
