"""The messages of the readings themselves: raw samples, acceleration, and the offset of the clock."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, WithJsonSchema

from gateway.messages.header import Message

Readings = Annotated[
    list[int] | list[float],  # counts are written as whole numbers
    WithJsonSchema({"type": "array", "items": {"type": "number"}}),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples(Message):
    """One block of raw samples, from which every other message can be computed again."""

    first_log_time_ns: Annotated[
        int, Field(description="gateway time of the first sample (monotonic, anchored to UTC at start)")
    ]
    period_ns: Annotated[
        float | None, Field(description="sample i is at first + round(i * period); null: see offsets_ns")
    ] = None
    offsets_ns: Annotated[
        list[int] | None,
        Field(description="times of the samples after the first, from the first; null where they are even"),
    ] = None
    unit: Literal["counts", "g"]
    packing: Annotated[
        Literal["difference", "plain"],
        Field(
            description="difference: the first entry is a value, each other entry the difference from the one before"
        ),
    ]
    x: Readings
    y: Readings
    z: Readings
    gx: Annotated[
        list[int] | None,
        Field(description="angular rate in the sensor's axes, counts, as differences; null without a gyroscope"),
    ] = None
    gy: list[int] | None = None
    gz: list[int] | None = None
    temperature_c: float | None = None
    lost: Annotated[int, Field(description="samples missing immediately before this block")]
    invalid: Annotated[int, Field(description="samples that arrived and could not be used")]
    saturated: Annotated[
        list[int] | None,
        Field(description="places of the samples at the end of what the sensor can read; null: it does not mark them"),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceleration(Message):
    """The specific force in the housing frame, g: mean, smallest and largest reading of each axis since the message before.

    Impacts and vibration show in the extremes at any rate of the samples.
    """

    x_g: Annotated[float | None, Field(description="mean; +1 g on the axis that points up at rest")] = None
    y_g: float | None = None
    z_g: float | None = None
    x_min_g: float | None = None
    x_max_g: float | None = None
    y_min_g: float | None = None
    y_max_g: float | None = None
    z_min_g: float | None = None
    z_max_g: float | None = None
    u_g: Annotated[
        float | None, Field(description="standard uncertainty of the calibration, of the axis with the largest one")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockOffset(Message):
    """The offset of the wall clock from gateway time, which never steps."""

    log_time_ns: int
    wall_offset_ns: Annotated[int, Field(description="UTC of the wall clock minus gateway time")]
    stepped: Annotated[
        bool, Field(description="whether the wall clock has stepped by more than 0.5 s since the last message")
    ]
