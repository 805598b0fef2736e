"""Types of option values, with messages that state what is allowed, and the extras that an option may need."""

import argparse
import importlib.util
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from gateway.errors import InputError

if TYPE_CHECKING:
    from gateway.recording.reading.interval import RecordingTime


Value = TypeVar("Value")
OF_THE_TWIN = ("casadi", "matplotlib", "scipy")


def above_zero(text: str) -> float:
    """Parse a finite number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0")
    return value


def at_least_zero(text: str) -> float:
    """Parse a finite number from 0 on."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
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


def parse_address(text: str) -> tuple[str, int]:
    """Parse the address that a server listens on. Raises `ValueError`."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ValueError(f"{text} is no address such as 127.0.0.1:8322")
    return host, int(port)


def require_twin() -> None:
    """Raise `InputError` where the twin's libraries are missing."""
    _require(OF_THE_TWIN, "twin")


def require_plots() -> None:
    """Raise `InputError` where the library of the figures is missing."""
    _require(("matplotlib",), "twin")


def require_parquet() -> None:
    """Raise `InputError` where the library for Parquet files is missing."""
    _require(("pyarrow",), "parquet")


def require_archive() -> None:
    """Raise `InputError` where the libraries of the archive are missing."""
    _require(("cryptography", "deltalake", "duckdb", "obstore", "pyarrow"), "archive")


def require_cluster() -> None:
    """Raise `InputError` where the client of a cluster is missing."""
    _require(("distributed",), "cluster")


def require_laser() -> None:
    """Raise `InputError` where the libraries for photographs and the printable board are missing."""
    _require(("cv2", "fpdf"), "laser")


def require_http() -> None:
    """Raise `InputError` where the HTTP server's libraries are missing."""
    _require(("starlette", "uvicorn"), "page")


def require_mqtt() -> None:
    """Raise `InputError` where the client of MQTT is missing."""
    _require(("paho",), "mqtt")


def require_opcua() -> None:
    """Raise `InputError` where the server of OPC UA is missing."""
    _require(("asyncua",), "opcua")


def require_foxglove() -> None:
    """Raise `InputError` where the server for viewers is missing."""
    _require(("foxglove",), "foxglove")


def require_certificates() -> None:
    """Raise `InputError` where the library for certificates is missing."""
    _require(("cryptography",), "security")


def _require(libraries: tuple[str, ...], extra: str) -> None:
    missing = [name for name in libraries if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"{' and '.join(missing)} not installed; try pip install 'plumbline-gateway[{extra}]'")
