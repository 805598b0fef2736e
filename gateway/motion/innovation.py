"""The innovation of a reading under each hypothesis: what was read less what was expected, with its covariance."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array


@dataclass(frozen=True, slots=True)
class Innovation:
    """An innovation divided by the root of its covariance: white, with unit variance if the hypothesis is right."""

    white: Array
    """Shape (m, 3)."""
    whitening: Array
    """Inverse of the covariance's lower Cholesky factor, shape (m, 3, 3)."""
    squared: Array
    """Normalised innovation squared, shape (m,)."""
    log_density: Array
    """Logarithm of the probability density, but for a constant, shape (m,)."""
    transverse_log_density: Array
    """The same of the two transverse readings alone."""

    @classmethod
    def of(cls, innovation: Array, spread: Array, noise: Array) -> "Innovation":
        """Return an innovation, shape (m, 3).

        `spread`: covariance of what was expected, shape (m, 3, 3); `noise`: variance of the reading, shape (m, 3).
        """
        covariance = spread.copy()
        covariance.reshape(len(spread), -1)[:, ::4] += noise
        root = np.linalg.cholesky(covariance)
        whitening: Array = np.asarray(np.linalg.inv(root), dtype=np.float64)
        white = np.matvec(whitening, innovation)
        cumulated = np.cumsum(0.5 * white * white + np.log(root.reshape(len(root), -1)[:, ::4]), axis=1)
        return cls(white, whitening, np.vecdot(white, white), -cumulated[:, 2], -cumulated[:, 1])
