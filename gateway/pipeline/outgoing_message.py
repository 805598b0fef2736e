"""What the pipeline hands to the sinks."""

from dataclasses import dataclass

from gateway.messages import Log, Message


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """A message on its way: its topic, and when it belongs in gateway time."""

    topic: str
    log_time_ns: int
    message: Message | Log
