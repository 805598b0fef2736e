"""Times of recordings as text."""

from datetime import UTC, datetime


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
