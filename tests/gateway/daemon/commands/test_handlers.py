"""Marks, written once and kept by the quota, and acknowledgements, which mean what the person had seen."""

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from devices.host_clock import HostClock
from gateway.authorization.caller import Caller, Role
from gateway.daemon.commands.handlers import WAITING, AcknowledgementService, MarkService
from gateway.daemon.commands.requests import RemoteRequest
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.messages import Mark
from gateway.pipeline.incidents import Acknowledgement, IncidentRegister
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recalibration.requests import Acknowledge, RequestError, SetMark, parse_payload
from gateway.recording.format.content import RecordingHeader
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.events import EventIndex, marker_path
from gateway.recording.segments.recorder import Recorder

REQUEST = {"id": "cli-12345678", "by": "ann", "text": "sling slipped, größte Last"}


def request(**change: Any) -> SetMark:
    return parse_payload(SetMark, json.dumps({**REQUEST, **change}).encode())


class Sink:
    """The queue of the recorder."""

    def __init__(self, room: bool = True) -> None:
        self.messages: list[EncodedMessage] = []
        self._room = room

    def send(self, message: EncodedMessage) -> bool:
        self.messages.append(message)
        return self._room


def service(sink: Sink) -> MarkService:
    return MarkService(WallClockMonitor(HostClock()), sink.send)


def test_a_mark_is_written_once_however_often_its_request_arrives() -> None:
    sink = Sink()
    marks = service(sink)
    answers = [marks.answer(request()) for _ in range(3)]
    assert [answer.accepted for answer in answers] == [True] * 3
    (sent,) = sink.messages
    assert isinstance(sent.message, Mark)
    assert (sent.topic, sent.message.by, sent.message.text) == ("mark", "ann", REQUEST["text"])


def test_the_reason_of_a_mark_is_kept_and_logged(caplog: pytest.LogCaptureFixture) -> None:
    sink = Sink()
    with caplog.at_level(logging.INFO):
        service(sink).answer(request(reason="call at 10:05"))
    (sent,) = sink.messages
    assert isinstance(sent.message, Mark)
    assert sent.message.reason == "call at 10:05"
    assert f"{REQUEST['text']} (call at 10:05)" in caplog.text


def test_a_mark_that_is_no_line_of_text_is_refused() -> None:
    for change in ({"text": ""}, {"text": "two\nlines"}, {"by": ""}, {"id": "x"}, {"more": 1}):
        with pytest.raises(RequestError, match=next(iter(change))):
            request(**change)


def test_a_line_break_in_a_mark_is_refused_in_words() -> None:
    with pytest.raises(RequestError, match="text: should be one line, without breaks"):
        request(text="two\nlines")


def test_a_mark_that_is_not_recorded_is_not_confirmed() -> None:
    marks = service(Sink(room=False))
    assert not marks.answer(request()).accepted


def test_a_mark_is_in_the_recording_and_protects_its_segment(tmp_path: Path) -> None:
    sink = Sink()
    service(sink).answer(request())
    header = RecordingHeader("0.1.0", "yard", "crane", "hook", "boot", "")
    recorder = Recorder(tmp_path, header, segment_s=60, fsync_s=1, quota_mb=10, events=EventIndex(60, 60))
    path = recorder.start(sink.messages[0].log_time_ns)
    recorder.write(sink.messages[0])
    recorder.close()
    file = open_recording(path)
    assert [file.decode(message).text for message in file.messages()] == [REQUEST["text"]]
    assert marker_path(path).exists()


ASKED_BY = {"id": "cli-12345678", "by": "ann"}


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
        content = Acknowledge.model_validate({**ASKED_BY, **request})
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


def test_what_cannot_be_acknowledged_is_refused_with_the_reason_and_recorded(caplog: pytest.LogCaptureFixture) -> None:
    site = Site()
    assert "no incident b00t-7" in site.ask(incident="b00t-7")[1]
    (line,) = caplog.messages
    assert line.startswith("acknowledgement by ann")
    assert line.endswith("refused: no incident b00t-7 is known, or it is too old")
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
