"""The separation of two hypotheses, from their signatures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.experiment_design.signatures import Signature
from gateway.twin.reconcile.residual.isolability import orthonormal, smallest_angle_cosine

Array = NDArray[np.float64]
MIN_SEPARATION_SIGMA = 5.0
"""Smallest residual that separates two hypotheses, in standard deviations of the noise. Basis: 1 in 10^6 by chance."""
MAX_COSINE = 0.9995
"""Largest cosine that separates. Basis: above it less than 3 % of a signature is specific, and no model of a crane is that
accurate."""


@dataclass(frozen=True, slots=True)
class Separation:
    """How well the recordings of an experiment separate two hypotheses."""

    cosine: float
    """Cosine of the smallest principal angle of their signatures, nuisance parameters projected out; 1 for equal signatures."""
    sigma: float
    """Residual if one of them, at its typical size and in its worst direction, is replaced by the other; the smaller of both."""

    @property
    def is_distinguishable(self) -> bool:
        """Whether the recordings separate them."""
        return self.sigma >= MIN_SEPARATION_SIGMA and self.cosine < MAX_COSINE


def separation_of(first: Signature, second: Signature) -> Separation:
    """Return the separation of two signatures."""
    cosine = smallest_angle_cosine(first.columns, second.columns)
    return Separation(cosine, min(_residual_sigma(first, second), _residual_sigma(second, first)))


def _residual_sigma(true: Signature, fitted: Signature) -> float:
    """Return the smallest residual of a signature of typical size after a fit of another one."""
    basis = orthonormal(fitted.columns)
    residual = true.typical - basis @ (basis.T @ true.typical)
    return float(np.linalg.svd(residual, compute_uv=False)[-1])
