"""Isolability: the angles between the signatures of effects, nuisance parameters projected out."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.output.result import Confusable

Array = NDArray[np.float64]
CONFUSABLE_COSINE = 0.95
"""Cosine of the angle from which two effects are hard to distinguish: less than a third of each signature is its own."""
INDISTINGUISHABLE_COSINE = 0.9999
"""Cosine from which two effects cannot be distinguished: their signatures differ by 1.4 %, less than the linearisation errs."""
RANK_TOLERANCE = 1e-7
"""Singular value, relative to the largest, below which columns are linearly dependent up to rounding."""


def smallest_angle_cosine(first: Array, second: Array) -> float:
    """Return the cosine of the smallest principal angle between two column spaces (Björck and Golub 1973); 0 if one is empty."""
    return _basis_cosine(orthonormal(first), orthonormal(second))


def confusable(signatures: Mapping[str, Array]) -> tuple[Confusable, ...]:
    """Return the pairs of effects, by columns (m, parameters), that are hard to distinguish, closest first."""
    names = sorted(signatures)
    bases = {name: orthonormal(signatures[name]) for name in names}
    pairs = []
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            cosine = _basis_cosine(bases[first], bases[second])
            if cosine > CONFUSABLE_COSINE:
                pairs.append(Confusable(first, second, cosine))
    return tuple(sorted(pairs, key=lambda pair: -pair.cosine))


def indistinguishable_pairs(signatures: Mapping[str, Array]) -> frozenset[frozenset[str]]:
    """Return the pairs of effects whose signatures coincide."""
    return frozenset(
        frozenset((pair.first, pair.second))
        for pair in confusable(signatures)
        if pair.cosine > INDISTINGUISHABLE_COSINE
    )


def orthonormal(columns: Array) -> Array:
    """Return an orthonormal basis of the space that columns (m, k) span, shape (m, rank)."""
    norms = np.linalg.norm(columns, axis=0)
    scaled: Array = columns[:, norms > 0] / norms[norms > 0]
    if not scaled.shape[1]:
        return scaled
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    basis: Array = left[:, singular > RANK_TOLERANCE * singular[0]]
    return basis


def project_out(basis: Array, columns: Array) -> Array:
    """Return what of columns (m,) or (m, k) is orthogonal to an orthonormal basis (m, rank)."""
    projected: Array = columns - basis @ (basis.T @ columns)
    return projected


def _basis_cosine(first: Array, second: Array) -> float:
    if not first.shape[1] or not second.shape[1]:
        return 0.0
    return float(min(1.0, np.linalg.svd(first.T @ second, compute_uv=False)[0]))
