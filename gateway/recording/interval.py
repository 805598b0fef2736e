"""An interval of a recording, between times that a user gives."""

from dataclasses import dataclass
from datetime import UTC, datetime
from math import isfinite
from typing import Literal

from gateway.errors import InputError
from gateway.recording.timestamp import iso_utc

DAY_NS = 86_400_000_000_000


@dataclass(frozen=True, slots=True)
class RecordingExtent:
    """The first and the last sample of a recording."""

    first_s: float
    last_s: float
    origin_utc_ns: int | None
    """UTC of time 0; None where it is not known."""

    def utc_ns(self, time_s: float) -> int | None:
        """Return the UTC of a time of the recording."""
        return None if self.origin_utc_ns is None else self.origin_utc_ns + round(time_s * 1e9)

    def __str__(self) -> str:
        text = f"0 to {self.last_s - self.first_s:.3f} s"
        first_ns, last_ns = self.utc_ns(self.first_s), self.utc_ns(self.last_s)
        return text if first_ns is None or last_ns is None else f"{text}, {iso_utc(first_ns)} to {iso_utc(last_ns)}"


@dataclass(frozen=True, slots=True)
class RecordingTime:
    """A time of a recording as a user gives it."""

    text: str
    """The user's own text, for messages."""
    value_ns: int
    since: Literal["first_sample", "epoch", "midnight"]
    """Origin of `value_ns`: the first sample, 1970-01-01 UTC, or midnight UTC of the recording's day."""

    def time_s(self, extent: RecordingExtent) -> float:
        """Return the time in seconds on the time axis of the recording. Raises `InputError` for UTC where it is not known."""
        if self.since == "first_sample":
            return extent.first_s + self.value_ns / 1e9
        first_ns = extent.utc_ns(extent.first_s)
        last_ns = extent.utc_ns(extent.last_s)
        if first_ns is None or last_ns is None:
            raise InputError(f"{self.text}: this recording has no UTC; give seconds from its start, {extent}")
        utc_ns = self.value_ns
        if self.since == "midnight":
            utc_ns += first_ns - first_ns % DAY_NS
            if utc_ns < first_ns and utc_ns + DAY_NS <= last_ns:  # a recording across midnight
                utc_ns += DAY_NS
        return extent.first_s + (utc_ns - first_ns) / 1e9


@dataclass(frozen=True, slots=True)
class RecordingInterval:
    """The part of a recording from `begin` until before `end`; None: from its first, or to its last sample."""

    begin: RecordingTime | None = None
    end: RecordingTime | None = None

    def limits_s(self, extent: RecordingExtent) -> tuple[float, float]:
        """Return begin and end on the time axis of the recording; a missing one is infinite.

        Raises `InputError` for an interval that is empty or outside the recording.
        """
        begin_s = float("-inf") if self.begin is None else self.begin.time_s(extent)
        end_s = float("inf") if self.end is None else self.end.time_s(extent)
        if self.begin is not None and begin_s > extent.last_s:
            raise InputError(f"--from {self.begin.text}: is after the recording, which is {extent}")
        if self.end is not None and end_s <= extent.first_s:
            raise InputError(f"--to {self.end.text}: is before the recording, which is {extent}")
        if self.begin is not None and self.end is not None and begin_s >= end_s:
            raise InputError(f"--to {self.end.text}: is not after --from {self.begin.text}; the recording is {extent}")
        return begin_s, end_s

    def describe_excess(self, extent: RecordingExtent) -> tuple[str, ...]:
        """Return a remark for each limit that is outside the recording."""
        begin_s, end_s = self.limits_s(extent)
        remarks = []
        if self.begin is not None and begin_s < extent.first_s:
            remarks.append(f"--from {self.begin.text} is before the recording, which is {extent}")
        if self.end is not None and end_s > extent.last_s:
            remarks.append(f"--to {self.end.text} is after the recording, which is {extent}")
        return tuple(remarks)


WHOLE_RECORDING = RecordingInterval()


def parse_recording_time(text: str) -> RecordingTime:
    """Parse `30`, `1:30` (from the first sample), `07:30:05` or `2026-11-22T07:30:00Z` (UTC). Raises `ValueError`."""
    if "-" in text or "T" in text:
        return RecordingTime(text, _epoch_ns(datetime.fromisoformat(text)), "epoch")
    *fields, last = text.removesuffix("Z").split(":")
    longer, seconds = [_whole_number(field) for field in fields], _number(last)
    if len(longer) > 2 or (longer and seconds >= 60) or (text.endswith("Z") and len(longer) < 2):
        raise ValueError(text)
    if len(longer) < 2:
        return RecordingTime(text, round((60 * sum(longer) + seconds) * 1e9), "first_sample")
    hours, minutes = longer
    if hours >= 24 or minutes >= 60 or len(fields[0]) != 2:  # 1:00:00 might mean an hour from the start
        raise ValueError(text)
    return RecordingTime(text, round((3600 * hours + 60 * minutes + seconds) * 1e9), "midnight")


def _number(text: str) -> float:
    """Parse a finite number without sign or exponent. Raises `ValueError`."""
    if not (text.isascii() and text.replace(".", "", 1).isdecimal() and isfinite(float(text))):
        raise ValueError(text)
    return float(text)


def _whole_number(text: str) -> int:
    """Parse digits. Raises `ValueError`."""
    if not (text.isascii() and text.isdecimal()):
        raise ValueError(text)
    return int(text)


def _epoch_ns(time: datetime) -> int:
    aware = time if time.tzinfo is not None else time.replace(tzinfo=UTC)
    return round(aware.timestamp() * 1_000_000) * 1000
