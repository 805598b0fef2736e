"""Messages on their way from the pipeline to the sinks, their header and their rate; time is an argument, never a clock."""

from collections import Counter
from dataclasses import dataclass
from typing import TypedDict

from gateway.messages import ClockQuality, Log, Message, Verdict
from gateway.topics import encode


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """A message with its topic and its gateway time."""

    topic: str
    log_time_ns: int
    message: Message | Log


@dataclass(frozen=True, slots=True)
class PipelineOutput:
    """What the pipeline returns for one block."""

    messages: list[OutgoingMessage]
    verdict: Verdict | None
    """The verdict of the condition message among `messages`; None without one."""


@dataclass(frozen=True, slots=True)
class EncodedMessage:
    """A message with its JSON. It is encoded once, and every sink takes the same bytes."""

    topic: str
    log_time_ns: int
    message: Message | Log
    payload: bytes

    @property
    def publish_time_ns(self) -> int:
        """UTC of the message, in ns since 1970."""
        if isinstance(self.message, Log):
            return self.message.timestamp.sec * 1_000_000_000 + self.message.timestamp.nsec
        return self.message.time_ns

    @property
    def sequence(self) -> int:
        """The message's number within its topic; 0 for lines of the log."""
        return 0 if isinstance(self.message, Log) else self.message.sequence


def encode_message(topic: str, message: Message | Log, log_time_ns: int) -> EncodedMessage:
    """Encode a message of a topic as JSON."""
    return EncodedMessage(topic, log_time_ns, message, encode(message))


@dataclass(frozen=True, slots=True)
class ClockState:
    """How gateway time relates to UTC, and whether the host's clock is synchronised."""

    quality: ClockQuality
    wall_offset_ns: int
    """UTC minus gateway time."""


@dataclass(frozen=True, slots=True)
class MessageTime:
    """The gateway time of a message, and the state of the clock at that time."""

    log_time_ns: int
    clock: ClockState

    @property
    def utc_ns(self) -> int:
        """UTC of the message, in ns since 1970."""
        return self.log_time_ns + self.clock.wall_offset_ns


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


class RateLimiter:
    """Allow one message per period of gateway time, on a fixed grid, for any length of the blocks."""

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * 1e9)
        self._slot: int | None = None

    def is_due(self, time_ns: int) -> bool:
        """Return whether a new period of the grid has begun since the last call."""
        slot = time_ns // self._period_ns
        if slot == self._slot:
            return False
        self._slot = slot
        return True
