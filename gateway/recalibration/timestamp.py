"""When something happens, told by whoever has a clock."""

from dataclasses import dataclass
from datetime import UTC, datetime


@dataclass(frozen=True, slots=True)
class Timestamp:
    """One instant."""

    time_ns: int
    """Gateway time: it never steps within a run."""
    utc_ns: int
    """As the wall clock has it."""

    @property
    def utc(self) -> str:
        """For people and records, to the millisecond."""
        at = datetime.fromtimestamp(self.utc_ns / 1e9, UTC)
        return at.isoformat(timespec="milliseconds").replace("+00:00", "Z")
