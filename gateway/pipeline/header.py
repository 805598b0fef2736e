"""The header fields that every message has."""

from collections import Counter
from typing import TypedDict

from gateway.messages import ClockQuality
from gateway.pipeline.clock_state import MessageTime


class Header(TypedDict):
    """The fields of `gateway.messages.Message` that differ between messages."""

    time_ns: int
    clock: ClockQuality
    sequence: int
    calibration_id: str | None


class HeaderMaker:
    """Numbers the messages of each topic and converts gateway time into UTC."""

    def __init__(self) -> None:
        self._sequence: Counter[str] = Counter()

    def make(self, topic: str, time: MessageTime, calibration_id: str | None) -> Header:
        """Return the header of the next message of a topic."""
        sequence = self._sequence[topic]
        self._sequence[topic] += 1
        return Header(time_ns=time.utc_ns, clock=time.clock.quality, sequence=sequence, calibration_id=calibration_id)
