"""What noise alone would reach: the largest score of all effects, on noise of the residual's own colour.

Surrogates keep the residual's spectrum and draw its phases anew (Theiler and others 1992), so that slow noise, which fits like a
slow effect, is counted as what it is. The largest score of a surrogate over all effects controls the whole family at once.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.residual.isolability import orthonormal

Array = NDArray[np.float64]
SURROGATES = 100
NULL_MARGIN = 1.5
"""On the largest of the surrogates: what a hundred draws do not show."""


def normal_score(drop: float, parameters: int) -> float:
    """A drop of chi-square as a normal deviate (Fisher 1922)."""
    return math.sqrt(2 * max(drop, 0.0)) - math.sqrt(2 * parameters - 1)


def null_threshold(signatures: Mapping[str, Array], residual: Array, rng: np.random.Generator) -> float:
    """The largest score that any effect has on noise like the residual (n, 3) in sigma; columns are of shape (3 n, k)."""
    bases = [orthonormal(columns) for columns in signatures.values()]
    bases = [basis for basis in bases if basis.shape[1]]
    highest = 0.0
    for _ in range(SURROGATES):
        drawn = phase_randomised_surrogate(residual, rng).ravel()
        for basis in bases:
            taken = basis.T @ drawn
            highest = max(highest, normal_score(float(taken @ taken), basis.shape[1]))
    return NULL_MARGIN * highest


def phase_randomised_surrogate(residual: Array, rng: np.random.Generator) -> Array:
    """Noise with the spectrum of each axis of (n, 3), random phases."""
    size = np.abs(np.fft.rfft(residual, axis=0))
    turned = size * np.exp(2j * np.pi * rng.random(size.shape))
    turned[[0, -1]] = size[[0, -1]] * np.sign(rng.normal(size=(2, size.shape[1])))  # these have no phase
    found: Array = np.fft.irfft(turned, len(residual), axis=0)
    return found
