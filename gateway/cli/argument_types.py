"""Types of option values, with messages that state what is allowed, and the option with the name of a person."""

import argparse
import getpass
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from gateway.cli.command import AddTo, option

if TYPE_CHECKING:
    from gateway.recording.reading.interval import RecordingTime

Value = TypeVar("Value")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def above_zero(text: str) -> float:
    """Parse a finite number above 0."""
    if not 0 < (value := _number(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0")
    return value


def at_least_zero(text: str) -> float:
    """Parse a finite number from 0 on."""
    if not 0 <= (value := _number(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0")
    return value


def whole_number(text: str) -> int:
    """Parse a whole number from 0 on."""
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text} is not a whole number from 0")
    return int(text)


def day_count(text: str) -> int:
    """Parse a whole number of days from 1 to a hundred years."""
    days = whole_number(text)
    if not 1 <= days <= 36500:
        raise argparse.ArgumentTypeError(f"{text} is not a number of days from 1 to 36500")
    return days


def key_fingerprint(text: str) -> str:
    """Parse the fingerprint of a key."""
    if re.fullmatch(r"[0-9a-f]{4}(-[0-9a-f]{4}){3}", text) is None:
        raise argparse.ArgumentTypeError(f"{text} is not a fingerprint such as 2693-bcf2-69b1-0e1d")
    return text


def recording_time(text: str) -> "RecordingTime":
    """Parse a time of a recording: seconds from its start, or UTC."""
    from gateway.recording.reading.interval import parse_recording_time

    try:
        return parse_recording_time(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text} is neither seconds from the start (30, 1:30) nor UTC (2026-11-22T07:30:00Z, or 07:30:05 on its first day)"
        ) from None


def duration_s(text: str) -> float:
    """Parse a duration in seconds, minutes or hours."""
    from gateway.recording.reading.interval import parse_duration

    try:
        return parse_duration(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text} is not a duration: seconds (90), minutes (1:30) or hours (1:00:00)"
        ) from None


def parsed_by(parse: Callable[[str], Value]) -> Callable[[str], Value]:
    """Return the type of an option that is read by a function whose `ValueError` says what is allowed."""

    def read(text: str) -> Value:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def operator_option(task: str) -> AddTo:
    """Return the option with the name of the person; `task` says what that person does."""
    return option("--by", metavar="NAME", help=f"person who {task} (default: the current user)")


def operator(arguments: argparse.Namespace) -> str:
    """Return the person that is named, or the current user."""
    try:
        return str(arguments.by or getpass.getuser())
    except (KeyError, OSError):
        return "unknown"
