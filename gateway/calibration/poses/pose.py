"""What every way of calibrating has in common: readings in, progress out, a fit at the end. Live and offline run the same."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Face = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""The sensor axis that points up."""


@dataclass(frozen=True, slots=True)
class RawReadings:
    """Readings as they leave the device, in the sensor's axes."""

    time_s: Array
    """Shape (n,), rising."""
    raw: Array
    """Shape (n, 3), in the record's unit."""
    temperature_c: float | None = None


@dataclass(frozen=True, slots=True)
class Pose:
    """One resting pose: the mean of its readings."""

    mean: tuple[float, float, float]
    type_a: tuple[float, float, float]
    """Standard uncertainty of each mean (GUM 4.2)."""
    count: int
    face: Face | None
    """None where no axis is near the vertical."""
    used: bool = True
    temperature_c: float | None = None
    noise: tuple[float, float, float] | None = None
    """Standard deviation of a single reading; None: from `type_a` and `count`, as for independent readings."""
    step: float = 0.0
    """Smallest step of the readings, for their quantisation."""

    def as_json(self) -> dict[str, Any]:
        """As the record has it."""
        return {
            "mean": list(self.mean),
            "type_a": list(self.type_a),
            "count": self.count,
            "face": self.face,
            "used": self.used,
            "temperature_c": self.temperature_c,
            "noise": None if self.noise is None else list(self.noise),
            "step": self.step,
        }
