"""The times of a report: UTC and the local time of the computer that makes it."""

from dataclasses import dataclass
from datetime import datetime

from gateway.incident.course import Course
from gateway.recording.reading.interval import zoned


@dataclass(frozen=True, slots=True)
class ReportClock:
    """Converts times of a course into text; `is_local`: this computer's time zone in place of UTC."""

    course: Course

    def moment(self, time_s: float, *, is_local: bool = False) -> datetime:
        """Return date and time."""
        return zoned(self.course.utc_ns(time_s), is_local=is_local)

    def time(self, time_s: float, *, is_local: bool = False) -> str:
        """Return `10:31:05.2`."""
        moment = self.moment(time_s, is_local=is_local)
        return f"{moment:%H:%M:%S}.{moment.microsecond // 100_000}"

    def date(self, time_s: float, *, is_local: bool = False) -> str:
        """Return `2026-11-22`."""
        return f"{self.moment(time_s, is_local=is_local):%Y-%m-%d}"

    def both(self, time_s: float) -> str:
        """Return `2026-11-22 10:31:05.2 UTC (12:31:05.2 EET)`."""
        local = self.moment(time_s, is_local=True)
        text = f"{self.date(time_s)} {self.time(time_s)} UTC"
        if local.utcoffset() == self.moment(time_s).utcoffset():
            return text
        day = "" if self.date(time_s) == self.date(time_s, is_local=True) else f"{self.date(time_s, is_local=True)} "
        return f"{text} ({day}{self.time(time_s, is_local=True)} {self.zone(time_s)})"

    def zone(self, time_s: float) -> str:
        """Return the name of the local time zone."""
        return self.moment(time_s, is_local=True).tzname() or "local"
