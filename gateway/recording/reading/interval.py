"""An interval of a recording, between times that a user gives."""

import re
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from math import isfinite
from typing import Literal

from gateway.errors import InputError

DAY_NS = 86_400_000_000_000
HOURS_MINUTES = re.compile(r"([01]\d|2[0-3]):[0-5]\d")
"""A time of day as people write it, which from the start of a recording is minutes and seconds."""


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
    """Origin of `value_ns`: the first sample, 1970-01-01 UTC, or midnight of the recording's day."""
    is_local: bool = False
    """Whether midnight is that of this computer's time zone, instead of UTC."""

    def time_s(self, extent: RecordingExtent) -> float:
        """Return the time in seconds on the time axis of the recording.

        Raises `InputError` for UTC where it is not known, and for `22:46` where that is a time of day of the recording too.
        """
        if self.since == "first_sample":
            self._require_clear(extent)
            return extent.first_s + self.value_ns / 1e9
        first_ns = extent.utc_ns(extent.first_s)
        last_ns = extent.utc_ns(extent.last_s)
        if first_ns is None or last_ns is None:
            raise InputError(f"{self.text}: this recording has no UTC; give seconds from its start, {extent}")
        utc_ns = self.value_ns
        if self.since == "midnight":
            utc_ns = self._on_day(first_ns)
            if utc_ns < first_ns and self._on_day(first_ns + DAY_NS) <= last_ns:  # a recording across midnight
                utc_ns = self._on_day(first_ns + DAY_NS)
        return extent.first_s + (utc_ns - first_ns) / 1e9

    def _require_clear(self, extent: RecordingExtent) -> None:
        if HOURS_MINUTES.fullmatch(self.text) is None or extent.origin_utc_ns is None:
            return
        at_s = parse_recording_time(f"{self.text}:00", is_local=self.is_local).time_s(extent)
        if extent.first_s - 60 < at_s <= extent.last_s:
            seconds = f"{self.value_ns / 1e9:g}"
            raise InputError(
                f"{self.text}: is {self.text}:00 of this recording's day, or {seconds} s from its start; write which"
            )

    def _on_day(self, utc_ns: int) -> int:
        """Return the UTC of this time of day on the day of another time."""
        day = zoned(utc_ns, is_local=self.is_local).date()
        time_of_day = (datetime.min + timedelta(microseconds=self.value_ns // 1000)).time()
        return _epoch_ns(datetime.combine(day, time_of_day), is_local=self.is_local)


@dataclass(frozen=True, slots=True)
class RecordingInterval:
    """The part of a recording from `begin` until before `end`; None: from its first, or to its last sample."""

    begin: RecordingTime | None = None
    end: RecordingTime | None = None
    last_s: float | None = field(default=None, kw_only=True)
    """Length of the interval, in place of `begin`."""

    def limits_s(self, extent: RecordingExtent) -> tuple[float, float]:
        """Return begin and end on the time axis of the recording; a missing one is infinite.

        Raises `InputError` for an interval that is empty or outside the recording.
        """
        begin_s = float("-inf") if self.begin is None else self.begin.time_s(extent)
        end_s = float("inf") if self.end is None else self.end.time_s(extent)
        if self.last_s is not None:
            begin_s = min(end_s, extent.last_s) - self.last_s
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


def parse_recording_time(text: str, *, is_local: bool = False) -> RecordingTime:
    """Parse `30`, `1:30` (from the first sample), `07:30:05` or `2026-11-22T07:30:00`. Raises `ValueError`.

    The last two are UTC, or with `is_local` of this computer's time zone; a zone in the text prevails.
    """
    if "-" in text or "T" in text:
        return RecordingTime(text, _epoch_ns(datetime.fromisoformat(text), is_local=is_local), "epoch")
    *fields, last = text.removesuffix("Z").split(":")
    longer, seconds = [_whole_number(field) for field in fields], _number(last)
    if len(longer) > 2 or (longer and seconds >= 60) or (text.endswith("Z") and len(longer) < 2):
        raise ValueError(text)
    if len(longer) < 2:
        return RecordingTime(text, round((60 * sum(longer) + seconds) * 1e9), "first_sample", is_local)
    hours, minutes = longer
    if hours >= 24 or minutes >= 60 or len(fields[0]) != 2:  # 1:00:00 might mean an hour from the start
        raise ValueError(text)
    value_ns = round((3600 * hours + 60 * minutes + seconds) * 1e9)
    return RecordingTime(text, value_ns, "midnight", is_local=is_local and not text.endswith("Z"))


def parse_duration(text: str) -> float:
    """Parse `90`, `1:30` (minutes) or `1:00:00` (hours) into seconds. Raises `ValueError`."""
    *fields, last = text.split(":")
    longer, seconds = [_whole_number(field) for field in fields], _number(last)
    if len(longer) > 2 or (longer and seconds >= 60) or (len(longer) == 2 and longer[1] >= 60):
        raise ValueError(text)
    for place, value in enumerate(reversed(longer), start=1):
        seconds += value * 60**place
    if seconds == 0:
        raise ValueError(text)
    return seconds


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


def _epoch_ns(time: datetime, *, is_local: bool) -> int:
    aware = time if time.tzinfo is not None or is_local else time.replace(tzinfo=UTC)
    return round(aware.timestamp() * 1_000_000) * 1000  # without a zone, Python takes the time for a local one


def iso_utc(time_ns: int) -> str:
    """Return a time in ISO 8601, in UTC, to the millisecond; `--from` and `--to` accept it."""
    return zoned(time_ns).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"


def zoned(time_ns: int, *, is_local: bool = False) -> datetime:
    """Return a UTC in ns as a date and time of UTC, or of this computer's time zone."""
    utc = datetime.fromtimestamp(time_ns / 1e9, tz=UTC)
    return utc.astimezone() if is_local else utc


def iso_utc_ns(time_ns: int) -> str:
    """Return a time in ISO 8601, in UTC, to the nanosecond."""
    return f"{datetime.fromtimestamp(time_ns // 10**9, tz=UTC):%Y-%m-%dT%H:%M:%S}.{time_ns % 10**9:09d}Z"
