"""The result of a fit: parameters, simulation, chi-square and covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to observations."""

    names: tuple[str, ...]
    """The effects of the model."""
    values: Array
    """Initial state and effect values, in the simulator's order."""
    free: NDArray[np.bool_]
    """Which values were fitted."""
    force_g: Array
    """Simulated, shape (n, 3)."""
    chi2: float
    """Sum over the samples that count."""
    normal: Array
    """Normal matrix of the free values, J^T J with the precision of a prior."""
    jacobian: Array
    """Derivatives of the simulation by all values, in sigma, shape (n, 3, values); of the last linearisation."""

    def covariance(self) -> Array:
        """Return the covariance of the free values under white noise; by the pseudo-inverse where some are not determined."""
        diagonal = np.diag(self.normal)
        scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        covariance: Array = np.linalg.pinv(self.normal / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
        return covariance
