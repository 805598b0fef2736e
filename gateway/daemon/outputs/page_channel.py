"""The gateway's end of the private channel to its page. No other thread of the gateway ever waits for the page."""

import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable

from gateway.daemon.storage.outbox_writer import RECENT_CHANGES
from gateway.page.channel import (
    ANSWER,
    MAX_FRAME_BYTES,
    PAST_ALERT,
    REPORT,
    REQUEST,
    Frame,
    encode_frame,
    open_pair,
    receive_frame,
)
from gateway.topics import TOPICS

SHOWN = frozenset(topic.name for topic in TOPICS.values() if topic.published and topic.name not in ("samples", "mark"))
"""The topics that the page shows."""
MAX_WAITING_FRAMES = {"alert": 64, PAST_ALERT: RECENT_CHANGES, ANSWER: 16}
"""Frames of one kind that may wait for the page, where each counts; of other kinds the newest alone. Basis: a choice; more than
the page asks for or alerts change at once, and a bound of the memory."""
FRAME_HEADROOM_BYTES = 128
"""Bytes of a packet beside its payload. Basis: a choice; kind, topic and times are short, and it is a five-hundredth of a
packet."""


class WaitingFrames:
    """The frames that wait for the page, oldest first.

    `put` never waits: too many of one kind replace their oldest, which is counted where each of them matters.
    """

    def __init__(self) -> None:
        self._ready = threading.Condition()
        self._frames: deque[Frame] = deque()
        self._closed = False
        self.lost = 0
        """Number of frames of `MAX_WAITING_FRAMES` that newer ones replaced."""

    def put(self, frame: Frame) -> None:
        """Add a frame."""
        with self._ready:
            waiting = [other for other in self._frames if other.kind == frame.kind]
            if len(waiting) >= MAX_WAITING_FRAMES.get(frame.kind, 1):
                self._frames.remove(waiting[0])
                self.lost += frame.kind in MAX_WAITING_FRAMES
            self._frames.append(frame)
            self._ready.notify()

    def get(self) -> Frame | None:
        """Wait for a frame; None once it is closed."""
        with self._ready:
            self._ready.wait_for(lambda: self._frames or self._closed)
            return None if self._closed else self._frames.popleft()

    def close(self) -> None:
        """End the waiting of the reader; frames that were not sent are forgotten."""
        with self._ready:
            self._closed = True
            self._ready.notify()


class _Connection:
    """The channel to one process of the page, with a thread for each direction."""

    def __init__(
        self,
        channel: socket.socket,
        first: list[Frame],
        answer: Callable[[bytes], bytes],
        note: Callable[[bytes], object],
    ) -> None:
        self.waiting = WaitingFrames()
        self._channel = channel
        self._answer = answer
        self._note = note
        for frame in first:
            self.waiting.put(frame)
        for name, work in (("page-send", self._send_all), ("page-receive", self._receive_all)):
            threading.Thread(target=work, name=name, daemon=True).start()

    def close(self) -> None:
        """End both threads, whatever they wait for."""
        self.waiting.close()
        try:
            self._channel.shutdown(socket.SHUT_RDWR)
        except OSError:
            return  # the page has ended already

    def _send_all(self) -> None:
        while (frame := self.waiting.get()) is not None:
            try:
                self._channel.send(encode_frame(frame))
            except OSError:  # the page has ended; it is started again with a new channel
                return

    def _receive_all(self) -> None:
        with self._channel:
            while True:
                try:
                    frame = receive_frame(self._channel)
                except (OSError, ValueError):
                    break
                if frame is None:
                    break
                if frame.kind == REQUEST:
                    self.waiting.put(Frame(ANSWER, time.monotonic(), self._answer(frame.payload)))
                elif frame.kind == REPORT:
                    self._note(frame.payload)
        self.waiting.close()


class PageChannel:
    """Passes messages on to the page and its requests to a handler.

    A page that starts gets the last changes of alerts and the last message of each topic at once.
    """

    def __init__(
        self,
        answer: Callable[[bytes], bytes],
        past_alerts: Callable[[], Iterable[bytes]] = tuple,
        note: Callable[[bytes], object] = bytes,
    ) -> None:
        """`answer` returns the answer to a request of the page; it is called by a thread of the channel and may wait.

        `past_alerts` returns the last changes of alerts, oldest first; `note` takes the page's reports, and does not wait.
        """
        self._answer = answer
        self._note = note
        self._past_alerts = past_alerts
        self._lock = threading.Lock()
        self._latest: dict[str, Frame] = {}
        self._connection: _Connection | None = None
        self._lost_before = 0
        self.refused = 0
        """Number of messages that were too large."""

    def put(self, topic: str, payload: bytes) -> None:
        """Add a message. Called by any thread; never waits."""
        if topic not in SHOWN:
            return
        if not _fits(payload):
            self.refused += 1
            return
        frame = Frame(topic, time.monotonic(), payload)
        with self._lock:
            self._latest[topic] = frame
            if self._connection is not None:
                self._connection.waiting.put(frame)

    @property
    def dropped(self) -> int:
        """Number of messages that the page did not get: more alerts and answers than may wait, or too large ones.

        Of other topics a page that is slow gets the newest message alone, by design.
        """
        with self._lock:
            lost = 0 if self._connection is None else self._connection.waiting.lost
            return self._lost_before + lost + self.refused

    def open(self, first: Frame) -> socket.socket:
        """Begin a channel whose first frame is `first`; return the page's end, which the caller closes after the start."""
        self.close()
        past = [Frame(PAST_ALERT, first.at_s, payload) for payload in self._past_alerts() if _fits(payload)]
        ours, theirs = open_pair()
        with self._lock:
            self._connection = _Connection(ours, [first, *past, *self._latest.values()], self._answer, self._note)
        return theirs

    def close(self) -> None:
        """End the channel; a page at its other end ends."""
        with self._lock:
            connection, self._connection = self._connection, None
            if connection is not None:
                self._lost_before += connection.waiting.lost
        if connection is not None:
            connection.close()


def _fits(payload: bytes) -> bool:
    return len(payload) <= MAX_FRAME_BYTES - FRAME_HEADROOM_BYTES
