"""How well two suspects are told apart, from their traces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.experiment_design.signatures import Signature
from gateway.twin.reconcile.residual.isolability import orthonormal, smallest_angle_cosine

Array = NDArray[np.float64]
SEEN_SIGMA = 5.0
SAME_TRACE = 0.9995
"""Cosine from which less than 3 % of a trace is its own: no model of a crane is true to that."""


@dataclass(frozen=True, slots=True)
class Separation:
    """Of two suspects in the recordings of a manoeuvre."""

    cosine: float
    """Of the smallest principal angle of what they can do, the nuisances projected out; 1 is the same trace."""
    sigma: float
    """What is left unexplained of the one, at its typical size and in its worst direction, when the other is fitted in its place;
    the smaller of both ways round."""

    @property
    def is_distinguishable(self) -> bool:
        """Both gates."""
        return self.sigma >= SEEN_SIGMA and self.cosine < SAME_TRACE


def separation(first: Signature, second: Signature) -> Separation:
    """Of a pair."""
    cosine = smallest_angle_cosine(first.freedom, second.freedom)
    return Separation(cosine, min(_unexplained(first, second), _unexplained(second, first)))


def _unexplained(true: Signature, fitted: Signature) -> float:
    basis = orthonormal(fitted.freedom)
    left = true.typical - basis @ (basis.T @ true.typical)
    return float(np.linalg.svd(left, compute_uv=False)[-1])
