"""The nominal sensitivity of a sensor that is not calibrated yet."""

from dataclasses import dataclass

import numpy as np

from devices.conversion import force_g
from gateway.numerics.array import Array


@dataclass(frozen=True, slots=True)
class NominalSensitivity:
    """Nominal sensitivity and zero of a sensor, the same for all axes or by axis."""

    units_per_g: float
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Reading at zero g in raw units; half of the supply voltage for an analogue sensor."""

    def in_g(self, mean: Array | tuple[float, ...]) -> Array:
        """Return a reading in nominal g, shape (3,)."""
        return force_g(np.asarray(mean, dtype=np.float64), np.array(self.zero), self.units_per_g)
