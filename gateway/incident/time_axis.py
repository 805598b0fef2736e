"""The times of a report, and the time axes of its figures: ticks at round times of UTC, and the local time above them."""

import math
from dataclasses import dataclass
from datetime import datetime

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter

from gateway.incident.course import Course
from gateway.recording.reading.interval import zoned

STEPS_S = (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200, 86400)
"""Distances of ticks. Definition: round steps of seconds, minutes and hours."""
MAX_TICKS = 8
"""Basis: a choice; labels of the time do not touch."""
TICK_ERROR_S = 1e-3
"""Basis: a choice; above the rounding of the times, below the smallest step."""
EDGE_SHARE = 0.03
"""Share of the axis before its end without a tick. Basis: half a label."""


@dataclass(frozen=True, slots=True)
class ReportClock:
    """Converts times of a course into text, in UTC, or with `is_local` in the time zone of the computer that makes the report."""

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


def tick_times(clock: ReportClock, begin_s: float, end_s: float) -> list[float]:
    """Return times of the course at which UTC is a round time, at most MAX_TICKS."""
    step_s = next((step for step in STEPS_S if (end_s - begin_s) / step <= MAX_TICKS), STEPS_S[-1])
    step_ns, begin_ns = round(step_s * 1e9), clock.course.utc_ns(begin_s)
    first_s = begin_s + (-begin_ns % step_ns) / 1e9
    last_s = end_s - EDGE_SHARE * (end_s - begin_s)
    return [first_s + number * step_s for number in range(math.floor((last_s - first_s) / step_s) + 1)]


def label_times(axes: Axes, clock: ReportClock, begin_s: float, end_s: float) -> None:
    """Put UTC below the axes."""
    axes.set_xlim(begin_s, end_s)
    axes.xaxis.set_major_locator(FixedLocator(tick_times(clock, begin_s, end_s)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda time_s, _place: tick_label(clock, time_s, end_s - begin_s)))
    axes.set_xlabel(f"UTC, {clock.date((begin_s + end_s) / 2)}")


def label_local_times(axes: Axes, clock: ReportClock, begin_s: float, end_s: float) -> None:
    """Put the local time above the axes where it differs from UTC."""
    if clock.moment(begin_s).utcoffset() == clock.moment(begin_s, is_local=True).utcoffset():
        return
    above = axes.secondary_xaxis("top")
    above.xaxis.set_major_locator(FixedLocator(tick_times(clock, begin_s, end_s)))
    above.xaxis.set_major_formatter(
        FuncFormatter(lambda time_s, _place: tick_label(clock, time_s, end_s - begin_s, is_local=True))
    )
    above.set_xlabel(f"local time, {clock.zone(begin_s)}, {clock.date((begin_s + end_s) / 2, is_local=True)}")


def tick_label(clock: ReportClock, time_s: float, span_s: float, *, is_local: bool = False) -> str:
    """Return the time of a tick on an axis of `span_s`."""
    tick_s = time_s + TICK_ERROR_S  # a tick a nanosecond early has the label of its round time
    if span_s < MAX_TICKS:
        return clock.time(tick_s, is_local=is_local)
    return f"{clock.moment(tick_s, is_local=is_local):%H:%M:%S}"
