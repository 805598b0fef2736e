"""The playback of recordings at their pace: on the bus, under keys and with a clock that say so, and to viewers as recorded."""

import json
import queue
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

import zenoh

from gateway import messages
from gateway.errors import InputError
from gateway.recording.format.content import logged_topics
from gateway.recording.reading.recording_file import Selection
from gateway.recording.reading.timeline import ReportProgress, Timeline, TimelineMessage, ignore_progress
from gateway.topics import ALIVE, KEY_PREFIX, TOPICS, encode

REPLAYED_SUFFIX = "-replayed"
"""Behind the sensor's name: a program that follows one sensor never takes a playback for it."""
MAX_PLAYED_GAP_S = 5.0
"""A longer gap of the recording is shortened to this. Basis: a choice; a person notices the gap and does not wait for hours."""
ANSWER_PERIOD_S = 0.1
"""Longest sleep between two looks for an end. Basis: a choice; an answer within what a person sees."""
MOST_AT_ONCE = 64
"""Messages that viewers get at once. Basis: a choice; far less than waits for one of them, and 3000 a second."""
JSON = zenoh.Encoding.APPLICATION_JSON
TOPIC_OF_PATH = {topic.path: topic for topic in TOPICS.values() if topic.published}


def playback_key(timeline: Timeline) -> str:
    """Return the prefix of the keys. Raises `InputError` for a recording that no gateway made."""
    origin = timeline.segments[0].origin
    if not origin:
        raise InputError(f"{timeline.name}: names no gateway; only recordings of the gateway can be played")
    return f"{KEY_PREFIX}{origin['site']}/{origin['crane']}/{origin['sensor']}{REPLAYED_SUFFIX}"


def schedule(
    messages: Iterable[TimelineMessage], speed: float, begin_s: float
) -> Iterator[tuple[float, TimelineMessage]]:
    """Yield each message with the time at which it is due, s: the first one at `begin_s`, the others at their pace."""
    due_s, newest_ns = begin_s, None
    for message in messages:
        time_ns = message.recorded.log_time_ns
        if newest_ns is not None and time_ns > newest_ns:
            due_s += min((time_ns - newest_ns) / 1e9, MAX_PLAYED_GAP_S) / speed
        newest_ns = time_ns if newest_ns is None else max(time_ns, newest_ns)
        yield due_s, message


class Playback:
    """Publishes the messages of a timeline at their pace, and answers queries for the status."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        speed: float,
        now_s: Callable[[], float] = time.monotonic,
        sleep_s: Callable[[float], object] = time.sleep,
    ) -> None:
        """`speed`: recorded seconds per second."""
        self._speed = speed
        self._now_s = now_s
        self._sleep_s = sleep_s
        self._latest: dict[str, bytes] = {}
        self._queries: queue.SimpleQueue[zenoh.Query] = queue.SimpleQueue()
        self._publishers = {
            topic.name: session.declare_publisher(
                f"{key}/{topic.name}",
                encoding=JSON,
                congestion_control=zenoh.CongestionControl.BLOCK,  # a playback can wait for a slow link
            )
            for topic in TOPIC_OF_PATH.values()
        }
        # the session may not be used inside its callbacks
        self._status = session.declare_queryable(f"{key}/rpc/status", self._queries.put)
        self._alive = session.liveliness().declare_token(f"{key}/{ALIVE}")
        self.published = 0
        """Number of messages so far."""

    def play(self, timeline: Timeline, selection: Selection, report: ReportProgress = ignore_progress) -> None:
        """Publish a selection. Raises `RecordingError`."""
        wanted = Selection(selection.begin_ns, selection.end_ns, frozenset(TOPIC_OF_PATH))
        for due_s, message in schedule(timeline.messages(wanted, report), self._speed, self._now_s()):
            content = message.decode()
            if isinstance(content, messages.Message):
                self._wait_until(due_s)
                self._publish(TOPIC_OF_PATH[message.recorded.topic].name, content)

    def _publish(self, topic: str, content: messages.Message) -> None:
        payload = encode(replace(content, clock="replayed"))
        self._latest[topic] = payload
        self._publishers[topic].put(payload)
        self.published += 1

    def _wait_until(self, due_s: float) -> None:
        """Wait, and answer queries meanwhile."""
        while True:
            self.answer_queries()
            left_s = due_s - self._now_s()
            if left_s <= 0:
                return
            self._sleep_s(min(left_s, ANSWER_PERIOD_S))

    def answer_queries(self) -> None:
        """Answer the waiting queries with the last message of each topic."""
        while not self._queries.empty():
            query = self._queries.get()
            latest = {topic: json.loads(payload) for topic, payload in self._latest.items() if topic != "samples"}
            with suppress(zenoh.ZError), query:  # the caller may have left
                query.reply(self._status.key_expr, json.dumps(latest), encoding=JSON)


class ViewerPlayback:
    """Hands out the messages of a timeline as they become due, byte for byte as they are recorded."""

    topics = tuple(logged_topics())
    has_own_clock = True
    dropped = invalid = 0

    def __init__(
        self, messages: Iterable[TimelineMessage], speed: float, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        """`messages`: of these topics alone; `speed`: recorded seconds per second."""
        self._messages, self._speed, self._now_s = messages, speed, now_s
        self._scheduled: Iterator[tuple[float, TimelineMessage]] | None = None
        self._next: tuple[float, TimelineMessage] | None = None
        self.played = 0
        """Number of messages so far."""

    def begin(self) -> None:
        """Let the first message become due. Raises `RecordingError`."""
        self._scheduled = schedule(self._messages, self._speed, self._now_s())
        self._next = next(self._scheduled, None)

    @property
    def is_at_end(self) -> bool:
        """Whether it has begun and all messages were handed out."""
        return self._scheduled is not None and self._next is None

    def take(self) -> list[tuple[str, bytes, int]]:
        """Return topic, content and time, ns, of the messages that are due. Raises `RecordingError`."""
        taken: list[tuple[str, bytes, int]] = []
        while self._scheduled is not None and self._next is not None and len(taken) < MOST_AT_ONCE:
            due_s, message = self._next
            if due_s > self._now_s():
                break
            recorded = message.recorded
            taken.append((recorded.topic.removeprefix("/"), recorded.data, recorded.log_time_ns))
            self._next = next(self._scheduled, None)
        self.played += len(taken)
        return taken
