"""Messages on their way from the pipeline to the sinks."""

from dataclasses import dataclass

from gateway.messages import Log, Message, Verdict
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
