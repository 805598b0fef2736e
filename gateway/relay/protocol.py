"""What the gateway and the process that switches the relay say to each other: one line each, over pipes.

The gateway sends the settings as JSON, then `ENERGISE` with every alert that is well, and `RELEASE` otherwise. The process
answers each line, and reports each change of its own, with the state of the output. The end of the pipe releases the relay.
"""

from dataclasses import asdict, dataclass
from json import dumps, loads
from typing import Literal

ENERGISE, RELEASE = b"energise\n", b"release\n"
RelayState = Literal["energised", "released", "failed"]
STATES_BY_LINE: dict[bytes, RelayState] = {b"energised": "energised", b"released": "released", b"failed": "failed"}
"""failed: the output could not be switched; what the relay does is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayParameters:
    """The settings of the process that switches the relay: either a command or a GPIO line."""

    watchdog_s: float
    command: list[str] | None = None
    command_timeout_s: float = 1.0
    repeat_s: float = 10.0
    chip: str | None = None
    line: int = 0
    active_low: bool = False
    pulse_hz: float | None = None

    def encode(self) -> bytes:
        """Return the settings as one line."""
        return dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def decode(cls, line: bytes) -> "RelayParameters":
        """Return the settings of a line that `encode` has written."""
        return cls(**loads(line))
