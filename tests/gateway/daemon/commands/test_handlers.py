"""Marks: written once, refused when they are no line of text, and kept by the quota."""

import json
from pathlib import Path
from typing import Any

import pytest

from devices.host_clock import HostClock
from gateway.daemon.commands.handlers import MarkService
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.messages import Mark
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recalibration.requests import RequestError, SetMark, parse_payload
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


def test_a_mark_that_is_no_line_of_text_is_refused() -> None:
    for change in ({"text": ""}, {"text": "two\nlines"}, {"by": ""}, {"id": "x"}, {"more": 1}):
        with pytest.raises(RequestError, match=next(iter(change))):
            request(**change)


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
