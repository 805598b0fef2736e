"""Which effects the data could tell apart: angles between what their signatures span, the nuisances projected out."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.output.result import Confusable

Array = NDArray[np.float64]
CONFUSABLE_COSINE = 0.95
"""Cosine from which two effects are reported as hard to tell apart."""

INDISTINGUISHABLE_COSINE = 0.9999
"""Cosine from which nothing in their traces tells them apart."""


def smallest_angle_cosine(first: Array, second: Array) -> float:
    """Cosine of the smallest principal angle of two column spaces (Björck, Golub 1973)."""
    a, b = orthonormal(first), orthonormal(second)
    if not a.shape[1] or not b.shape[1]:
        return 0.0
    return float(min(1.0, np.linalg.svd(a.T @ b, compute_uv=False)[0]))


def confusable(signatures: Mapping[str, Array]) -> tuple[Confusable, ...]:
    """Pairs of effects whose columns (m, parameters) lie closer than `CLOSE`, closest first."""
    names = sorted(signatures)
    bases = {name: orthonormal(signatures[name]) for name in names}
    found = []
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            if bases[first].shape[1] and bases[second].shape[1]:
                cosine = float(np.linalg.svd(bases[first].T @ bases[second], compute_uv=False)[0])
                if cosine > CONFUSABLE_COSINE:
                    found.append(Confusable(first, second, min(1.0, cosine)))
    return tuple(sorted(found, key=lambda pair: -pair.cosine))


def indistinguishable_pairs(signatures: Mapping[str, Array]) -> frozenset[frozenset[str]]:
    """Pairs of effects whose signatures are one."""
    return frozenset(
        frozenset((pair.first, pair.second))
        for pair in confusable(signatures)
        if pair.cosine > INDISTINGUISHABLE_COSINE
    )


def orthonormal(columns: Array) -> Array:
    """A basis of what the columns span, by singular values over 1e-7 of the largest."""
    norms = np.linalg.norm(columns, axis=0)
    scaled: Array = columns[:, norms > 0] / norms[norms > 0]
    if not scaled.shape[1]:
        return scaled
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    basis: Array = left[:, singular > 1e-7 * singular[0]]
    return basis
