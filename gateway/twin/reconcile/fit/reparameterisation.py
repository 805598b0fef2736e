"""Changes of coordinates in which a fit converges in fewer steps."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Reparameterisation(ABC):
    """An invertible change from the effect values (k,) of a simulator to the coordinates of a fit."""

    @abstractmethod
    def to_fitted(self, effect_values: Array) -> Array:
        """Return the coordinates of the fit."""

    @abstractmethod
    def to_physical(self, fitted: Array) -> Array:
        """Return the effect values."""

    @abstractmethod
    def physical_by_fitted(self, fitted: Array) -> Array:
        """Return the derivatives of the effect values by the coordinates of the fit, shape (k, k)."""

    @abstractmethod
    def fitted_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the bounds of the coordinates, from those of the effect values (k,)."""


class InverseCutoffs(Reparameterisation):
    """Cutoff frequencies by their inverse, a delay, for which the initial state compensates in proportion."""

    def __init__(self, positions: Sequence[int]) -> None:
        """`positions` are those of the cutoffs among the effect values."""
        self._positions = list(positions)

    def to_fitted(self, effect_values: Array) -> Array:
        """Return the values with each cutoff replaced by its inverse."""
        fitted = effect_values.copy()
        fitted[self._positions] = 1 / effect_values[self._positions]
        return fitted

    def to_physical(self, fitted: Array) -> Array:
        """Return the effect values."""
        return self.to_fitted(fitted)

    def physical_by_fitted(self, fitted: Array) -> Array:
        """Return the derivatives: -f^2 for a cutoff f."""
        diagonal = np.ones_like(fitted)
        diagonal[self._positions] = -1 / fitted[self._positions] ** 2
        return np.diag(diagonal)

    def fitted_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the bounds; the inverse of an upper bound is a lower one."""
        fitted_lower, fitted_upper = lower.copy(), upper.copy()
        fitted_lower[self._positions] = 1 / upper[self._positions]
        fitted_upper[self._positions] = 1 / lower[self._positions]
        return fitted_lower, fitted_upper
