"""The time of the day in which segments are sent."""

from dataclasses import dataclass
from datetime import datetime, time, timedelta


@dataclass(frozen=True, slots=True)
class TimeWindow:
    """A time of the day, in this computer's time zone; it may go over midnight."""

    begin: time
    end: time

    def wait_s(self, now: datetime) -> float:
        """Return the time until it is open; 0: it is."""
        clock = now.time()
        is_open = self.begin <= clock < self.end if self.begin < self.end else not self.end <= clock < self.begin
        if is_open:
            return 0.0
        opens = datetime.combine(now.date(), self.begin, now.tzinfo)
        return ((opens if opens > now else opens + timedelta(days=1)) - now).total_seconds()


def parse_window(text: str) -> TimeWindow:
    """Parse `22:00-05:00`. Raises `ValueError`."""
    begin, _, end = text.partition("-")
    try:
        window = TimeWindow(time.fromisoformat(begin.strip()), time.fromisoformat(end.strip()))
    except ValueError:
        raise ValueError(f"{text} is no time of the day such as 22:00-05:00") from None
    if window.begin == window.end:
        raise ValueError(f"{text} is never open; give two times such as 22:00-05:00")
    return window
