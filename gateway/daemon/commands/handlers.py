"""The handlers of the verbs of `gateway.verbs`; status, schema, alerts and marks are answered here."""

import json
import logging
from collections.abc import Callable, Mapping

import msgspec

from gateway.daemon.commands.acknowledgement_service import AcknowledgementService
from gateway.daemon.commands.recalibration_service import RecalibrationService
from gateway.daemon.commands.requests import RemoteRequest, RequestHandler
from gateway.daemon.commands.worker import CommandWorker
from gateway.daemon.runtime.wall_clock import WallClockMonitor
from gateway.daemon.storage.outbox_writer import OutboxWriter
from gateway.messages import Mark
from gateway.outbox import Position
from gateway.pipeline.outgoing_message import EncodedMessage, HeaderMaker, MessageTime, encode_message
from gateway.recalibration.requests import AnsweredRequests, FetchAlerts, FetchSchema, RequestAnswer, SetMark
from gateway.topics import TOPICS, json_schema
from gateway.verbs import VERBS as TABLE

log = logging.getLogger("plumbline.mark")
REMEMBERED = 256
"""Number of answers that are kept. Basis: a choice; a client repeats a request after seconds, and the memory is bounded."""
JSON = "application/json"
NOT_IN_STATUS = "samples"


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
        mark = Mark(**self._headers.make("mark", now, None), id=request.id, by=request.by, text=request.text)
        if not self._send(encode_message("mark", mark, now.log_time_ns)):
            text = "the recorder is too busy; the mark is not in the recording"
            return RequestAnswer(id=request.id, request="mark", accepted=False, text=text)
        log.info("mark by %s: %s", request.by, request.text)
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
