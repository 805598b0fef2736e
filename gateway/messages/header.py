"""The header of every message, and the types that several messages share."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

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


ReasonCode = Literal[
    # why the angle is not known
    "no_reading",
    "no_samples",
    "off_rope",
    "too_short",
    "undetermined",
    "turning_point",
    "clipped_long",
    "uncalibrated_at_load",
    "not_configured",
    "axis_constant",
    "axis_silent",
    "implausible_mean",
    # why it is less certain
    "contradiction",
    "gyro_left_out",
    "temperature",
    # what acts, and what else is noticed
    "pivot_accelerates",
    "rope_length_changes",
    "wind",
    "fast_oscillation",
    "askew",
    # what the condition's gates have found
    "complete",
    "axes_alive",
    "not_clipped",
    "no_impact",
    "not_shaken",
    "norm_hanging",
    "explained",
    "no_spin",
    "rate_pendulum",
    "norm_static",
    "not_turning",
    "free_pendulum",
    "small_swing",
    "still",
    "vibration",
    # what a person who turns the sensor for a calibration should do, or did
    "pose_place",
    "pose_hold",
    "pose_turn",
    "pose_taken",
    "pose_moved",
    "pose_implausible",
    "pose_off_face",
    "pose_near_another",
    "pose_not_still",
    "pose_enough",
    # why there is no advice on the screws of a housing, or nothing left to turn
    "align_no_calibration",
    "align_moving",
    "align_off_rope",
    "align_averaging",
    "align_noisy",
    "align_aligned",
]


class Reason(str):
    """A reason in words, with the code of its kind."""

    code: ReasonCode

    def __new__(cls, code: ReasonCode, words: str) -> "Reason":
        """Return the reason of a kind."""
        made = super().__new__(cls, words)
        made.code = code
        return made

    def __reduce__(self) -> tuple[type["Reason"], tuple[Any, ...]]:
        return Reason, (self.code, str(self))
