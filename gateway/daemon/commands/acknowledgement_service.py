"""Acknowledgements of incidents: they wait here for the processing thread, because they are inputs of the pipeline."""

from collections.abc import Callable

from gateway.daemon.commands.requests import RequestQueue
from gateway.pipeline.incidents import Acknowledgement, IncidentRegister
from gateway.recalibration.requests import Acknowledge, AnsweredRequests, RequestAnswer

WAITING = 16
"""Requests that may wait. Basis: a choice; a person acknowledges alerts one by one, and more of them are refused at once."""
REMEMBERED = 256
"""Number of answers that are kept. Basis: a choice; a repeated request comes within seconds, and the memory is bounded."""


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
    return RequestAnswer(id=request.id, request="acknowledge", accepted=bool(found), text=text)


def _nothing_found(incident_id: str | None, incidents: IncidentRegister) -> str:
    """Return why there is nothing to acknowledge."""
    if incident_id is None:
        return "no incident waits for an acknowledgement"
    incident = incidents.find(incident_id)
    if incident is None:
        return f"no incident {incident_id} is known since the start of the gateway"
    if incident.acknowledged_by is None:
        return f"{incident_id} was raised, or rose to a higher level, after this was asked; look at it and ask again"
    return f"{incident_id} was acknowledged before, by {incident.acknowledged_by}"
