"""Marks in the recording, set by people over the bus."""

import logging
from collections import deque
from collections.abc import Callable

from gateway.daemon.wall_clock import WallClockMonitor
from gateway.messages import Mark
from gateway.pipeline.clock_state import MessageTime
from gateway.pipeline.header import HeaderMaker
from gateway.pipeline.outgoing_message import EncodedMessage, encode_message
from gateway.recalibration.journal import RequestAnswer
from gateway.recalibration.requests import SetMark

log = logging.getLogger("plumbline.mark")
REMEMBERED = 256
"""Ids of requests that are known to be done; a client repeats a request whose answer was lost."""


class MarkService:
    """Writes marks; used by the thread of the remote calls alone."""

    def __init__(self, wall_clock: WallClockMonitor, send: Callable[[EncodedMessage], bool]) -> None:
        """`send` puts a message into the queues of recording and bus; False: the recording is too busy."""
        self._wall_clock = wall_clock
        self._send = send
        self._headers = HeaderMaker()
        self._done: deque[str] = deque(maxlen=REMEMBERED)

    def answer(self, request: SetMark) -> RequestAnswer:
        """Write the mark of a request, once for each id."""
        now = MessageTime(self._wall_clock.clock.now_ns(), self._wall_clock.state)
        if request.id not in self._done:
            header = self._headers.make("mark", now, None)
            mark = Mark(**header, id=request.id, by=request.by, text=request.text)
            if not self._send(encode_message("mark", mark, now.log_time_ns)):
                text = "the recorder is too busy; the mark is not in the recording"
                return RequestAnswer(id=request.id, request="mark", accepted=False, text=text)
            self._done.append(request.id)
            log.info("mark by %s: %s", request.by, request.text)
        return RequestAnswer(id=request.id, request="mark", accepted=True, text=f"marked: {request.text}")
