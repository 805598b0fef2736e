"""Intervals of a recording, in seconds from its start and in UTC."""

import time
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from gateway.errors import InputError
from gateway.recording.reading.interval import (
    RecordingExtent,
    RecordingInterval,
    iso_utc,
    parse_duration,
    parse_recording_time,
)


def utc_ns(text: str) -> int:
    return int(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()) * 10**9


def extent(first: str = "2026-11-22T07:30:00", length_s: float = 600.0, first_s: float = 0.0) -> RecordingExtent:
    return RecordingExtent(first_s, first_s + length_s, utc_ns(first) - round(first_s * 1e9))


@pytest.mark.parametrize(
    ("text", "expected_s"),
    [
        ("30", 30.0),
        ("30.25", 30.25),
        ("1:30", 90.0),
        ("1:05.5", 65.5),
        ("90:00", 5400.0),
        ("07:30:05", 5.0),
        ("07:30:05.5Z", 5.5),
        ("07:29:00", -60.0),
        ("2026-11-22T07:31:00Z", 60.0),
        ("2026-11-22T07:31:00.125", 60.125),
        ("2026-11-22T08:31:00+01:00", 60.0),
        ("20261122T073100Z", 60.0),
    ],
)
@pytest.mark.parametrize("first_s", [0.0, 1000.0])
def test_times_are_seconds_from_the_start_or_utc(text: str, expected_s: float, first_s: float) -> None:
    time_s = parse_recording_time(text).time_s(extent(first_s=first_s))
    assert time_s == pytest.approx(first_s + expected_s, abs=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "-5",
        "1e3",
        "nan",
        "1:60",
        "1:2:3:4",
        "1:00:00",
        "24:00:00",
        "07:60:00",
        "1.5:30",
        "30Z",
        "1:30Z",
        "now",
        "²",
        "9" * 400,
    ],
)
def test_other_texts_are_no_times(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        parse_recording_time(text)


def test_time_of_day_after_midnight_is_on_the_next_day() -> None:
    night = extent("2026-11-22T23:59:00", 120.0)
    assert parse_recording_time("00:00:30").time_s(night) == 90.0
    assert parse_recording_time("23:59:30").time_s(night) == 30.0
    assert parse_recording_time("00:02:00").time_s(night) < 0  # not in the recording


@pytest.fixture
def tokyo(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run in a time zone nine hours ahead of UTC."""
    monkeypatch.setenv("TZ", "JST-9")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.usefixtures("tokyo")
@pytest.mark.parametrize(
    ("text", "expected_s"),
    [
        ("16:30:05", 5.0),
        ("2026-11-22T16:31:00", 60.0),
        ("07:30:05Z", 5.0),
        ("2026-11-22T07:31:00Z", 60.0),
        ("30", 30.0),
    ],
)
def test_local_times_are_of_the_zone_of_this_computer_unless_they_state_another(text: str, expected_s: float) -> None:
    assert parse_recording_time(text, is_local=True).time_s(extent()) == pytest.approx(expected_s, abs=1e-6)


@pytest.mark.usefixtures("tokyo")
def test_local_time_of_day_after_local_midnight_is_on_the_next_day() -> None:
    night = extent("2026-11-22T14:59:00", 120.0)
    assert parse_recording_time("00:00:30", is_local=True).time_s(night) == 90.0


@pytest.mark.parametrize(("text", "expected_s"), [("90", 90.0), ("1:30", 90.0), ("0.5", 0.5), ("1:01:05", 3665.0)])
def test_durations_are_seconds_minutes_or_hours(text: str, expected_s: float) -> None:
    assert parse_duration(text) == expected_s


@pytest.mark.parametrize("text", ["", "0", "-1", "1:60", "1:60:00", "1:2:3:4", "nan", "1h"])
def test_other_texts_are_no_durations(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        parse_duration(text)


def test_last_part_ends_with_the_recording_or_before_the_end_given() -> None:
    assert RecordingInterval(last_s=20.0).limits_s(extent()) == (580.0, float("inf"))
    assert RecordingInterval(end=parse_recording_time("100"), last_s=20.0).limits_s(extent()) == (80.0, 100.0)
    assert RecordingInterval(last_s=700.0).limits_s(extent())[0] == -100.0


def test_printed_times_are_accepted_again() -> None:
    time_ns = utc_ns("2026-11-22T07:31:00") + 125_000_000
    assert parse_recording_time(iso_utc(time_ns)).value_ns == time_ns


def interval(begin: str | None, end: str | None) -> RecordingInterval:
    return RecordingInterval(*(None if text is None else parse_recording_time(text) for text in (begin, end)))


def test_missing_limits_are_open() -> None:
    assert interval(None, None).limits_s(extent()) == (float("-inf"), float("inf"))
    assert interval("10", "20").limits_s(extent()) == (10.0, 20.0)


@pytest.mark.parametrize(
    ("begin", "end", "text"),
    [
        ("700", None, "--from 700: is after the recording, which is 0 to 600.000 s, 2026-11-22T07:30:00.000Z to"),
        (None, "07:29:59", "--to 07:29:59: is before the recording, which is 0 to 600.000 s"),
        ("20", "10", "--to 10: is not after --from 20; the recording is 0 to 600.000 s"),
    ],
)
def test_an_interval_outside_the_recording_is_refused_with_its_extent(
    begin: str | None, end: str | None, text: str
) -> None:
    with pytest.raises(InputError, match=text.replace(".", r"\.")):
        interval(begin, end).limits_s(extent())


def test_utc_needs_a_recording_with_utc() -> None:
    with pytest.raises(InputError, match="07:30:05: this recording has no UTC; give seconds from its start, 0 to 45"):
        interval("07:30:05", None).limits_s(RecordingExtent(5.0, 50.0, None))


def test_limits_beyond_the_recording_are_remarked() -> None:
    assert interval("0", "600").describe_excess(extent()) == ()
    begin, end = interval("07:29:00", "700").describe_excess(extent())
    assert begin.startswith("--from 07:29:00 is before the recording, which is 0 to 600.000 s")
    assert end.startswith("--to 700 is after the recording")
