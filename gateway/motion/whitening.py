"""Whitening of mixtures: with what was known before the first reading as N(0, I), information beyond it is P^-1 - I."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gateway.motion.mixing import Mixture
from gateway.numerics.array import Array

SMALLEST_VARIANCE = 1e-12
"""After whitening; keeps what rounding leaves positive."""


@dataclass(frozen=True, slots=True)
class Whitening:
    """The transformation that makes a prior N(0, I) under each hypothesis.

    A state that a hypothesis does not have, or that is exactly known, gets the variance 1, so that it contributes nothing.
    """

    mean: Array
    """Shape (m, k)."""
    root: Array
    """Shape (m, k, k)."""
    is_active: NDArray[np.bool_]
    """Which states a hypothesis has, shape (m, k)."""

    @classmethod
    def of(cls, prior: Mixture) -> Self:
        """Return the whitening by a prior."""
        is_active = np.diagonal(prior.covariance, axis1=1, axis2=2) > 0
        root: Array = np.asarray(np.linalg.cholesky(_with_unit_variance(prior.covariance, is_active)), dtype=np.float64)
        return cls(prior.state, root, is_active)

    def apply(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return whitened states and covariances, shapes (..., m, k) and (..., m, k, k)."""
        inverse = np.linalg.inv(self.root)
        white = np.einsum("mij,...mj->...mi", inverse, np.where(self.is_active, state - self.mean, 0.0))
        return white, inverse @ _with_unit_variance(covariance, self.is_active) @ inverse.swapaxes(-1, -2)

    def restore(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return states and covariances from whitened ones."""
        both = self.is_active[:, :, None] & self.is_active[:, None, :]
        return (
            self.mean + np.where(self.is_active, np.einsum("mij,...mj->...mi", self.root, state), 0.0),
            np.where(both, self.root @ covariance @ self.root.swapaxes(-1, -2), 0.0),
        )


def _with_unit_variance(covariance: Array, is_active: NDArray[np.bool_]) -> Array:
    both = is_active[:, :, None] & is_active[:, None, :]
    found: Array = np.where(both, covariance, np.eye(covariance.shape[-1]) * ~is_active[:, None, :])
    return found


@dataclass(frozen=True, slots=True)
class Information:
    """What a whitened Gaussian says beyond the prior: exp(-x'Jx/2 + h'x)."""

    matrix: Array
    """J, shape (..., k, k)."""
    vector: Array
    """h, shape (..., k)."""
    variance: Array
    """Eigenvalues of the covariance, shape (..., k)."""
    along: Array
    """The mean along the eigenvectors, shape (..., k)."""

    @classmethod
    def of(cls, state: Array, covariance: Array) -> Self:
        """Return the information of whitened Gaussians; none along directions less certain than the prior."""
        variance, axes = np.linalg.eigh(covariance)
        variance = np.maximum(variance, SMALLEST_VARIANCE)
        along = np.einsum("...ji,...j->...i", axes, state)
        gained = np.maximum(1 / variance - 1, 0.0)
        vector = np.einsum("...ij,...j->...i", axes, np.where(gained > 0, along / variance, 0.0))
        return cls((axes * gained[..., None, :]) @ axes.swapaxes(-1, -2), vector, variance, along)


def with_share_of_information(mixture: Mixture, prior: Mixture, share: float) -> Mixture:
    """Return the mixture with a share of its information beyond the prior."""
    whitening = Whitening.of(prior)
    information = Information.of(*whitening.apply(mixture.state, mixture.covariance))
    covariance: Array = np.asarray(
        np.linalg.inv(np.eye(mixture.state.shape[-1]) + share * information.matrix), dtype=np.float64
    )
    state = share * np.einsum("...ij,...j->...i", covariance, information.vector)
    return Mixture(*whitening.restore(state, covariance), mixture.weight)
