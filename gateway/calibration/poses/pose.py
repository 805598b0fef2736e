"""Readings of a device, and a resting pose: the mean of the readings in one attitude."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from devices.conversion import force_g
from gateway.numerics.array import Array

Face = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""Sensor axis that points up."""


@dataclass(frozen=True, slots=True)
class NominalSensitivity:
    """Nominal sensitivity and zero of a sensor, the same for all axes or by axis."""

    units_per_g: float
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Reading at zero g in raw units; half of the supply voltage for an analogue sensor."""

    def in_g(self, mean: Array | tuple[float, ...]) -> Array:
        """Return a reading in nominal g, shape (3,)."""
        return force_g(np.asarray(mean, dtype=np.float64), np.array(self.zero), self.units_per_g)


@dataclass(frozen=True, slots=True)
class RawReadings:
    """Readings as the device delivers them, in the sensor's axes."""

    time_s: Array
    """Time of each reading, rising, shape (n,)."""
    raw: Array
    """Readings in the unit of the record, shape (n, 3)."""
    temperature_c: float | None = None


@dataclass(frozen=True, slots=True)
class Pose:
    """The mean of the readings in one resting pose."""

    mean: tuple[float, float, float]
    type_a: tuple[float, float, float]
    """Standard uncertainty of each mean, type A (GUM 4.2)."""
    count: int
    """Number of readings."""
    face: Face | None
    """Face on which the sensor lies; None if no axis is near the vertical."""
    used: bool = True
    """Whether the fit uses the pose."""
    temperature_c: float | None = None
    noise: tuple[float, float, float] | None = None
    """Standard deviation of one reading; None: computed from `type_a` and `count`, as for uncorrelated readings."""
    step: float = 0.0
    """Quantisation step of the readings; 0 if they are not quantised."""

    @property
    def reading_sigma(self) -> Array:
        """Standard deviation of one reading, shape (3,)."""
        if self.noise is not None:
            return np.array(self.noise)
        return np.array([u * np.sqrt(self.count) for u in self.type_a])

    def as_json(self) -> dict[str, Any]:
        """Return the pose as the calibration record stores it."""
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
