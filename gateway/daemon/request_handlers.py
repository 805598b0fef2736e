"""The handlers of the verbs of `gateway.verbs`."""

import json
from collections.abc import Callable, Mapping

from gateway.daemon.acknowledgement_service import AcknowledgementService
from gateway.daemon.alert_history import AlertHistory
from gateway.daemon.command_worker import CommandWorker
from gateway.daemon.mark_service import MarkService
from gateway.daemon.recalibration_service import RecalibrationService
from gateway.daemon.remote_request import RemoteRequest, RequestHandler
from gateway.recalibration.requests import FetchSchema, SetMark
from gateway.topics import TOPICS, json_schema
from gateway.verbs import VERBS as TABLE

JSON = "application/json"
NOT_IN_STATUS = "samples"


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
