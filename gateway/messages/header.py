"""The header of every message, and the types that several messages share."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

SCHEMA_VERSION: Literal[1] = 1
"""Version of every message and JSON output: raised when a field is removed, renamed or changes its meaning."""


ClockQuality = Literal["synchronised", "free_running", "replayed"]


CalibrationStatus = Literal["calibrated", "factory", "as_recorded", "uncalibrated"]


Degrees = Annotated[float, Field(description="degrees")]


Seconds = Annotated[float, Field(description="seconds")]


Vector = Annotated[list[float], Field(min_length=3, max_length=3, description="x, y, z in the housing frame")]


Interval = Annotated[list[float], Field(min_length=2, max_length=2, description="[low, high]")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """The header of every message."""

    schema_version: Annotated[Literal[1], Field(description="version of the message's fields")] = SCHEMA_VERSION
    time_ns: Annotated[int, Field(description="UTC of the (newest) sample that the message describes, ns since 1970")]
    clock: ClockQuality
    sequence: Annotated[int, Field(description="number of the message within its topic since start, from 0")]
    calibration_id: Annotated[str | None, Field(description="the calibration record in force; null: none")] = None
