"""The playback of recordings on the bus, under keys and with a clock that say so."""

import json
import queue
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import zenoh

from gateway import messages
from gateway.errors import InputError
from gateway.recording.reading.recording_file import Selection
from gateway.recording.reading.timeline import ReportProgress, Timeline, ignore_progress
from gateway.topics import TOPICS, encode

REPLAYED_SUFFIX = "-replayed"
"""Behind the sensor's name: a program that follows one sensor never takes a playback for it."""
MAX_PLAYED_GAP_S = 5.0
"""A longer gap of the recording is shortened to this. Basis: a choice; a person notices the gap and does not wait for hours."""
ANSWER_PERIOD_S = 0.1
"""Longest sleep between two looks for an end. Basis: a choice; an answer within what a person sees."""
JSON = zenoh.Encoding.APPLICATION_JSON
TOPIC_OF_PATH = {topic.path: topic for topic in TOPICS.values() if topic.published}


def playback_key(timeline: Timeline) -> str:
    """Return the prefix of the keys. Raises `InputError` for a recording that no gateway made."""
    origin = timeline.segments[0].origin
    if not origin:
        raise InputError(f"{timeline.name}: names no gateway; only recordings of the gateway can be played")
    return f"plumbline/v1/{origin['site']}/{origin['crane']}/{origin['sensor']}{REPLAYED_SUFFIX}"


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
        self._alive = session.liveliness().declare_token(f"{key}/alive")
        self.published = 0
        """Number of messages so far."""

    def play(self, timeline: Timeline, selection: Selection, report: ReportProgress = ignore_progress) -> None:
        """Publish a selection. Raises `RecordingError`."""
        wanted = Selection(selection.begin_ns, selection.end_ns, frozenset(TOPIC_OF_PATH))
        due_s, newest_ns = self._now_s(), None
        for message in timeline.messages(wanted, report):
            content = message.decode()
            if not isinstance(content, messages.Message):
                continue
            if newest_ns is not None and content.time_ns > newest_ns:
                due_s += min((content.time_ns - newest_ns) / 1e9, MAX_PLAYED_GAP_S) / self._speed
            newest_ns = content.time_ns if newest_ns is None else max(newest_ns, content.time_ns)
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
