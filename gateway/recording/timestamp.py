"""Times of recordings as text."""

from datetime import UTC, datetime


def iso_utc(time_ns: int) -> str:
    """Return a time in ISO 8601, in UTC, to the millisecond; `--from` and `--to` accept it."""
    return datetime.fromtimestamp(time_ns / 1e9, tz=UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
