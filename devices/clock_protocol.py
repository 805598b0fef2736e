"""The clock as a device sees it, apart from that of the host: what a configuration may choose needs no time."""

from typing import Protocol


class Clock(Protocol):
    """The clock that a device uses; tests provide their own."""

    def now_ns(self) -> int:
        """Return the gateway time."""
        ...

    def sleep_s(self, seconds: float) -> None:
        """Wait; return at once for zero or less."""
        ...
