"""Time as the pipeline takes it: an argument, never a clock."""

from dataclasses import dataclass

from gateway.messages import ClockQuality


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
