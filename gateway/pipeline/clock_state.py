"""What the pipeline is told of the wall clock."""

from dataclasses import dataclass

from gateway.messages import ClockQuality


@dataclass(frozen=True, slots=True)
class ClockState:
    """UTC of a sample is its gateway time plus the offset; how far to believe it is the quality."""

    quality: ClockQuality
    wall_offset_ns: int
