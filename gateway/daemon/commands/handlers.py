"""The handlers of the verbs of `gateway.verbs`; status, schema, alerts and marks are answered here.

Acknowledgements of incidents wait here for the processing thread, because they are inputs of the pipeline.
"""

import json
import logging
from collections.abc import Callable, Mapping

import msgspec

from gateway.daemon.commands.requests import RemoteRequest, RequestHandler, RequestQueue
from gateway.daemon.commands.worker import CommandWorker, RecalibrationService
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.storage.outbox_writer import OutboxWriter
from gateway.messages import Mark
from gateway.outbox import Position
from gateway.pipeline.incidents import Acknowledgement, IncidentRegister
from gateway.pipeline.outgoing_message import EncodedMessage, HeaderMaker, MessageTime, encode_message
from gateway.recalibration.requests import (
    Acknowledge,
    AnsweredRequests,
    FetchAlerts,
    FetchSchema,
    RequestAnswer,
    SetMark,
)
from gateway.topics import TOPICS, json_schema
from gateway.verbs import VERBS as TABLE

WAITING = 16
"""Requests that may wait. Basis: a choice; a person acknowledges alerts one by one, and more of them are refused at once."""
REMEMBERED = 256
"""Number of answers that are kept. Basis: a choice; a repeated request comes within seconds, and the memory is bounded."""
log = logging.getLogger("plumbline.mark")
alert_log = logging.getLogger("plumbline.alert")
JSON = "application/json"
NOT_IN_STATUS = "samples"


class AcknowledgementService:
    """Answers the requests of bus and page by the processing thread."""

    def __init__(self) -> None:
        self.requests = RequestQueue(WAITING)
        """`submit` may be called by any thread; a reply comes within a block, or within 0.1 s where no samples come."""
        self._answers = AnsweredRequests(REMEMBERED)

    def serve(self, incidents: IncidentRegister, acknowledge: Callable[[Acknowledgement], None]) -> None:
        """Answer one waiting request, so that many of them do not delay a block; `acknowledge` puts it into the pipeline."""
        if (request := self.requests.take()) is not None:
            asked_ns = None if request.caller is None else request.caller.asked_ns
            request.answer(self._answer(request.expect(Acknowledge), asked_ns, incidents, acknowledge))

    def _answer(
        self,
        request: Acknowledge,
        asked_ns: int | None,
        incidents: IncidentRegister,
        acknowledge: Callable[[Acknowledgement], None],
    ) -> RequestAnswer:
        known = self._answers.get(request.id)
        return known or self._answers.add(_acknowledge(request, asked_ns, incidents, acknowledge))


def _acknowledge(
    request: Acknowledge,
    asked_ns: int | None,
    incidents: IncidentRegister,
    acknowledge: Callable[[Acknowledgement], None],
) -> RequestAnswer:
    """Acknowledge the incident of a request, or without one all that nobody has acknowledged.

    What was raised after the caller asked, or rose to a higher level, it cannot have meant: a request that comes late silences
    nothing else.
    """
    waiting = [
        incident_id
        for incident_id in incidents.unacknowledged()
        if asked_ns is None or not incidents.was_raised_after(incident_id, asked_ns)
    ]
    wanted = waiting if request.incident is None else [request.incident]
    found = [incident_id for incident_id in wanted if incident_id in waiting]
    for incident_id in found:
        acknowledge(Acknowledgement(incident_id, request.by, request.reason))
    text = f"{', '.join(found)} by {request.by}" if found else _nothing_found(request.incident, incidents)
    if not found:  # who tried, and in vain, stands in the recordings, too
        because = f" ({request.reason})" if request.reason else ""
        alert_log.warning("acknowledgement by %s%s refused: %s", request.by, because, text)
    return RequestAnswer(id=request.id, request="acknowledge", accepted=bool(found), text=text)


def _nothing_found(incident_id: str | None, incidents: IncidentRegister) -> str:
    """Return why there is nothing to acknowledge."""
    if incident_id is None:
        return "no incident waits for an acknowledgement"
    incident = incidents.find(incident_id)
    if incident is None:
        return f"no incident {incident_id} is known, or it is too old"
    if incident.acknowledged_by is None:
        return f"{incident_id} was raised, or rose to a higher level, after this was asked; look at it and ask again"
    return f"{incident_id} was acknowledged before, by {incident.acknowledged_by}"


class MarkService:
    """Writes marks; used by the thread of the remote calls alone."""

    def __init__(self, wall_clock: WallClockMonitor, send: Callable[[EncodedMessage], bool]) -> None:
        """`send` puts a message into the queues of recording and bus; False: the recording is too busy."""
        self._wall_clock = wall_clock
        self._send = send
        self._headers = HeaderMaker()
        self._answers = AnsweredRequests(REMEMBERED)

    def answer(self, request: SetMark) -> RequestAnswer:
        """Write the mark of a request, once for each id."""
        if (known := self._answers.get(request.id)) is not None:
            return known
        now = MessageTime(self._wall_clock.clock.now_ns(), self._wall_clock.state)
        header = self._headers.make("mark", now, None)
        mark = Mark(**header, id=request.id, by=request.by, text=request.text, reason=request.reason)
        if not self._send(encode_message("mark", mark, now.log_time_ns)):
            text = "the recorder is too busy; the mark is not in the recording"
            return RequestAnswer(id=request.id, request="mark", accepted=False, text=text)
        log.info("mark by %s: %s%s", request.by, request.text, f" ({request.reason})" if request.reason else "")
        return self._answers.add(
            RequestAnswer(id=request.id, request="mark", accepted=True, text=f"marked: {request.text}")
        )


class AlertHistory:
    """Reads the outbox; used by the thread of the remote calls alone."""

    def __init__(self, outbox: OutboxWriter) -> None:
        self._outbox = outbox

    def answer(self, request: RemoteRequest) -> None:
        """Answer with a page of changes, oldest first."""
        wanted = request.expect(FetchAlerts)
        try:
            page = self._outbox.page_after(Position(wanted.after, wanted.boot))
        except OSError as error:
            request.refuse(f"the outbox cannot be read: {error.strerror or error}")
            return
        alerts = [msgspec.json.decode(change.payload) for change in page.changes]
        request.reply(True, {"alerts": alerts, "more": page.more, "complete": page.complete})


def make_handlers(
    latest: Callable[[], Mapping[str, bytes]],
    recalibration: RecalibrationService,
    commands: CommandWorker,
    marks: MarkService,
    acknowledgements: AcknowledgementService,
    alert_history: AlertHistory,
) -> dict[str, RequestHandler]:
    """Return the handlers by verb; `latest` returns the last message of each topic."""

    def report_status(request: RemoteRequest) -> None:
        topics = {topic: json.loads(text) for topic, text in latest().items() if topic != NOT_IN_STATUS}
        request.reply(True, topics)

    return {
        "status": report_status,
        "schema": _answer_schema,
        "fetch": recalibration.fetch,
        "alerts": alert_history.answer,
        "mark": lambda request: request.answer(marks.answer(request.expect(SetMark))),
        "acknowledge": acknowledgements.requests.submit,
        **dict.fromkeys(commands.verbs, commands.requests.submit),
    }


def _answer_schema(request: RemoteRequest) -> None:
    """Answer with the JSON Schema of a topic, or with what there is: topics with their encoding, verbs with their requests."""
    topic = request.expect(FetchSchema).topic
    if topic is None:
        topics = {
            name: {"schema": each.schema_name, "encoding": JSON, "rate": each.rate}
            for name, each in TOPICS.items()
            if each.published
        }
        verbs = {name: {"role": verb.role, "request": verb.request.model_json_schema()} for name, verb in TABLE.items()}
        request.reply(True, {"topics": topics, "verbs": verbs})
    elif topic in TOPICS and TOPICS[topic].published:
        request.reply(True, json_schema(topic))
    else:
        request.refuse(f"no topic {topic!r} is published; rpc/schema without a topic lists them")
