"""What every message carries, counted in one place."""

from collections import Counter
from typing import TypedDict

from gateway.messages import ClockQuality
from gateway.pipeline.clock_state import ClockState


class Header(TypedDict):
    """The fields of `gateway.messages.Message`."""

    time_ns: int
    clock: ClockQuality
    sequence: int
    calibration_id: str | None


class HeaderMaker:
    """Numbers the messages of each topic and turns gateway time into UTC."""

    def __init__(self) -> None:
        self._sequence: Counter[str] = Counter()

    def make(self, topic: str, log_time_ns: int, clock: ClockState, calibration_id: str | None) -> Header:
        """The header of the next message of a topic."""
        sequence = self._sequence[topic]
        self._sequence[topic] += 1
        return Header(
            time_ns=log_time_ns + clock.wall_offset_ns,
            clock=clock.quality,
            sequence=sequence,
            calibration_id=calibration_id,
        )
