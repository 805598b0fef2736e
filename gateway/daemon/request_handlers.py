"""The handlers of the verbs of `gateway.verbs`."""

import json
from collections.abc import Callable, Mapping

from gateway.daemon.acknowledgement_service import AcknowledgementService
from gateway.daemon.alert_history import AlertHistory
from gateway.daemon.mark_service import MarkService
from gateway.daemon.recalibration_service import RecalibrationService
from gateway.daemon.remote_request import RemoteRequest, RequestHandler
from gateway.recalibration.requests import VERBS, SetMark

NOT_IN_STATUS = "samples"


def make_handlers(
    latest: Callable[[], Mapping[str, bytes]],
    recalibration: RecalibrationService,
    marks: MarkService,
    acknowledgements: AcknowledgementService,
    alert_history: AlertHistory,
    configuration: Mapping[str, RequestHandler],
) -> dict[str, RequestHandler]:
    """Return the handlers by verb; `latest` returns the last message of each topic; `configuration` has those of its verbs."""

    def report_status(request: RemoteRequest) -> None:
        topics = {topic: json.loads(text) for topic, text in latest().items() if topic != NOT_IN_STATUS}
        request.reply(True, topics)

    return {
        "status": report_status,
        "fetch": recalibration.fetch,
        "alerts": alert_history.answer,
        "mark": lambda request: request.answer(marks.answer(request.expect(SetMark))),
        "acknowledge": acknowledgements.submit,
        **configuration,
        **dict.fromkeys(VERBS, recalibration.submit),
    }
