"""Marks in the recording, set by people over the bus."""

import logging
from collections.abc import Callable

from gateway.daemon.wall_clock import WallClockMonitor
from gateway.messages import Mark
from gateway.pipeline.clock_state import MessageTime
from gateway.pipeline.header import HeaderMaker
from gateway.pipeline.outgoing_message import EncodedMessage, encode_message
from gateway.recalibration.request_answers import AnsweredRequests, RequestAnswer
from gateway.recalibration.requests import SetMark

log = logging.getLogger("plumbline.mark")
REMEMBERED = 256
"""Number of answers that are kept."""


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
