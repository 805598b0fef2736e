"""Surrogate test: the largest score of all effects on random signals that have the spectrum of the residual.

Surrogates have the residual's spectrum and random phases (Theiler et al. 1992), so that slow noise, which resembles a slow
effect, is accounted for. The largest score of a surrogate over all effects controls the error rate of the whole family.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.residual.isolability import orthonormal

Array = NDArray[np.float64]
SURROGATES = 100
"""Number of surrogates: noise alone exceeds the largest of them once in 100 tests."""
NULL_MARGIN = 1.5
"""Factor on the largest score of the surrogates: no false alarm in 40 tests on strongly correlated noise."""


def normal_score(chi2_drop: float, n_parameters: int) -> float:
    """Return a decrease of chi-square as an approximately standard normal variable (Fisher 1922)."""
    return math.sqrt(2 * max(chi2_drop, 0.0)) - math.sqrt(2 * n_parameters - 1)


def null_threshold(signatures: Mapping[str, Array], residual: Array, rng: np.random.Generator) -> float:
    """Return the score that no effect reaches on noise like the residual (n, 3) in sigma; signatures are (3 n, parameters)."""
    bases = [orthonormal(columns) for columns in signatures.values()]
    bases = [basis for basis in bases if basis.shape[1]]
    largest = 0.0
    for _ in range(SURROGATES):
        surrogate = phase_randomised_surrogate(residual, rng).ravel()
        for basis in bases:
            projected = basis.T @ surrogate
            largest = max(largest, normal_score(float(projected @ projected), basis.shape[1]))
    return NULL_MARGIN * largest


def phase_randomised_surrogate(residual: Array, rng: np.random.Generator) -> Array:
    """Return noise with the spectrum of each axis of a residual (n, 3) and random phases."""
    magnitude = np.abs(np.fft.rfft(residual, axis=0))
    transform = magnitude * np.exp(2j * np.pi * rng.random(magnitude.shape))
    signs = np.sign(rng.normal(size=(2, magnitude.shape[1])))
    transform[[0, -1]] = magnitude[[0, -1]] * signs  # the first and the last are real
    surrogate: Array = np.fft.irfft(transform, len(residual), axis=0)
    return surrogate
