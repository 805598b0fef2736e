"""Acknowledgements: done once for each id, one for each block, refused where there is nothing to acknowledge."""

from collections.abc import Mapping
from typing import Any

import pytest

from gateway.authorization.caller import Caller, Role
from gateway.daemon.commands.handlers import WAITING, AcknowledgementService
from gateway.daemon.commands.requests import RemoteRequest
from gateway.pipeline.incidents import Acknowledgement, IncidentRegister
from gateway.recalibration.requests import Acknowledge, RequestError, parse_payload

REQUEST = {"id": "cli-12345678", "by": "ann"}


class Site:
    """A register with one open incident, and what was put into the pipeline."""

    def __init__(self) -> None:
        self.incidents = IncidentRegister("b00t")
        self.incidents.update("swing", "raised", "trip", None, 0.1, 5.0)
        self.service = AcknowledgementService()
        self.given: list[Acknowledgement] = []
        self.answers: list[tuple[bool, str]] = []

    def acknowledge(self, given: Acknowledgement) -> None:
        self.given.append(given)
        incident = self.incidents.find(given.incident)
        assert incident is not None
        incident.acknowledged_by = given.by

    def reply(self, accepted: bool, content: Mapping[str, Any]) -> None:
        self.answers.append((accepted, content["text" if accepted else "reason"]))

    def submit(self, asked_s: float | None = None, **request: object) -> None:
        content = Acknowledge.model_validate({**REQUEST, **request})
        caller = Caller("ann", Role.OPERATOR, "certificate", None if asked_s is None else round(1e9 * asked_s))
        self.service.requests.submit(RemoteRequest("acknowledge", content, caller, self.reply))

    def ask(self, asked_s: float | None = None, **request: object) -> tuple[bool, str]:
        self.submit(asked_s, **request)
        self.service.serve(self.incidents, self.acknowledge)
        return self.answers[-1]


def test_an_acknowledgement_without_an_incident_is_for_all_that_wait() -> None:
    site = Site()
    site.incidents.update("lean", "raised", "trip", None, 0.1, 6.0)
    assert site.ask(reason="load set down") == (True, "b00t-1, b00t-2 by ann")
    assert site.given == [Acknowledgement(f"b00t-{number}", "ann", "load set down") for number in (1, 2)]


def test_a_late_acknowledgement_silences_nothing_that_was_raised_after_it_was_asked() -> None:
    site = Site()
    site.incidents.update("lean", "raised", "trip", None, 0.1, 9.0)
    assert site.ask(8.0) == (True, "b00t-1 by ann")
    accepted, text = site.ask(8.0, id="cli-1234567a", incident="b00t-2")
    assert (accepted, "after this was asked" in text) == (False, True)
    site.incidents.update("swing", "raised", "trip", None, 0.1, 11.0)  # the same incident, at a higher level
    accepted, text = site.ask(10.0, id="cli-1234567b", incident="b00t-1")
    assert (accepted, "rose to a higher level" in text) == (False, True)
    assert site.ask(12.0, id="cli-1234567c") == (True, "b00t-1, b00t-2 by ann")


def test_the_same_request_is_done_once_and_answered_each_time() -> None:
    site = Site()
    answers = [site.ask(incident="b00t-1") for _ in range(3)]
    assert [accepted for accepted, _ in answers] == [True] * 3
    assert len(site.given) == 1


def test_what_cannot_be_acknowledged_is_refused_with_the_reason() -> None:
    site = Site()
    assert "no incident b00t-7" in site.ask(incident="b00t-7")[1]
    site.ask(id="cli-1234567a", incident="b00t-1")
    assert "acknowledged before, by ann" in site.ask(id="cli-1234567b", incident="b00t-1")[1]
    assert site.ask(id="cli-1234567c") == (False, "no incident waits for an acknowledgement")
    assert len(site.given) == 1


@pytest.mark.parametrize("change", [b'"incident": "../etc"', b'"by": "two\\nlines"'])
def test_an_acknowledgement_of_the_wrong_form_is_refused(change: bytes) -> None:
    with pytest.raises(RequestError):
        parse_payload(Acknowledge, b'{"id": "cli-12345678", "by": "ann", ' + change + b"}")


def test_one_request_is_answered_at_a_time_and_too_many_are_refused() -> None:
    site = Site()
    for _ in range(WAITING + 1):
        site.submit()
    assert site.answers == [(False, "busy: too many requests are waiting")]
    assert site.service.requests.dropped == 1
    site.service.serve(site.incidents, site.acknowledge)
    assert len(site.answers) == 2
