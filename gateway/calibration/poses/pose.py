"""Readings of a device, and a resting pose: the mean of the readings in one attitude, with its uncertainty.

The uncertainty of the mean is of type A, with the correlation of readings in time, and of type B, by quantisation.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from devices.conversion import force_g
from gateway.numerics.array import Array

Face = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""Sensor axis that points up."""
K_CORRELATED = 3.0
"""Standard deviations by which the scatter of window means must exceed that of uncorrelated readings, to count as correlation.
Basis: a choice; chance reaches it in 0.1 % of the rests."""


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

    @property
    def quantisation_u(self) -> Array:
        """Standard uncertainty of each mean by quantisation, shape (3,)."""
        return quantisation_u(self.step, self.reading_sigma)

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


def temperature_range(temperatures_c: Iterable[float | None]) -> dict[str, int | float] | None:
    """Return mean, minimum and maximum of the known temperatures, °C; None if no temperature was read."""
    known = [temperature_c for temperature_c in temperatures_c if temperature_c is not None]
    return {"mean": float(np.mean(known)), "min": min(known), "max": max(known)} if known else None


def correlation_factor(means: Array, counts: Array, sigma: Array) -> float:
    """Return the factor by which correlation enlarges the uncertainty of the mean, by batch means; 1 for uncorrelated readings.

    `means` of consecutive windows, shape (k, 3); number of readings in each, shape (k,); standard deviation of a reading
    within a window, shape (3,). The factor is 1 unless the scatter of the means is significant: the larger of the two estimates
    would on average overstate the uncertainty of white noise.
    """
    noisy = sigma > 0
    freedom = (len(means) - 1) * int(noisy.sum())
    if freedom < 1:
        return 1.0
    weights = counts[:, None]
    centre = (weights * means).sum(axis=0) / weights.sum()
    scatter = (weights * (means - centre) ** 2).sum(axis=0)
    ratio = float((scatter[noisy] / sigma[noisy] ** 2).sum()) / freedom
    return float(np.sqrt(ratio)) if ratio > 1 + K_CORRELATED * np.sqrt(2 / freedom) else 1.0


def quantisation_u(step: float, sigma: Array) -> Array:
    """Return the standard uncertainty of a mean of quantised readings, shape (3,), in the unit of `step`.

    Noise of standard deviation sigma dithers the quantiser: the remaining error of a mean is a sine of the value over the step
    with amplitude step/pi exp(-2 pi^2 (sigma/step)^2), its first harmonic. Without noise the error is rectangular.
    """
    if step <= 0:
        return np.zeros(3)
    dithered = np.exp(-2 * (np.pi * sigma / step) ** 2) / (np.pi * np.sqrt(2))
    return np.asarray(step * np.where(sigma > 0, dithered, 1 / np.sqrt(12)))
