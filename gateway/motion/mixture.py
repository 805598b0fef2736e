"""Gaussians with weights, one for each hypothesis, and how they exchange probability (Blom and Bar-Shalom 1988)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

IndexArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Mixture:
    """State and covariance under each hypothesis, with its weight: shapes (m, n), (m, n, n) and (m,)."""

    state: Array
    covariance: Array
    weight: Array

    def moments(self) -> tuple[Array, Array]:
        """Return mean and covariance over all hypotheses, shapes (n,) and (n, n)."""
        mean = self.weight @ self.state
        deviation = self.state - mean
        covariance = np.tensordot(self.weight, self.covariance, 1)
        return mean, covariance + (self.weight[:, None] * deviation).T @ deviation


@dataclass(frozen=True, slots=True)
class Ending:
    """Hypotheses that end only where one of the states is zero."""

    sources: IndexArray
    """Hypotheses that may end, shape (k,)."""
    targets: IndexArray
    """Those that follow them, shape (k,)."""
    state: int
    variance: float
    """Of the state once it has ended."""


NO_ENDING = Ending(np.empty(0, np.intp), np.empty(0, np.intp), 0, 1.0)
NEGLIGIBLE = 1e-9
"""Weight of all that may end, below which it makes no difference how it does."""


def exchange(mixture: Mixture, transition: Array, ending: Ending = NO_ENDING) -> tuple[Mixture, Array, Array]:
    """Return the mixture after the hypotheses have exchanged probability, what each (row) took from each and, behind, from each
    ending one, shape (m, m + k), and the probabilities of the exchange, shape (m, m).

    `transition`: probabilities from row to column, shape (m, m), of an ending one if its state were zero. Without its condition
    an ending would bring all speeds with it, at each step anew, and what has come to rest would never be sure of it.
    """
    joint = mixture.weight[:, None] * transition
    state, covariance = mixture.state, mixture.covariance
    if mixture.weight[ending.sources].sum() > NEGLIGIBLE:
        ended, overlap = _conditioned(mixture, ending)
        ends = np.zeros((len(ending.sources), len(joint)))
        ends[np.arange(len(ends)), ending.targets] = joint[ending.sources, ending.targets] * overlap
        joint[ending.sources, ending.targets] = 0.0
        joint = np.concatenate([joint, ends])
        joint /= joint.sum()
        state, covariance = np.concatenate([state, ended.state]), np.concatenate([covariance, ended.covariance])
    weight = joint.sum(axis=0)
    share = (joint / weight).T
    mean = share @ state
    deviation = state - mean[:, None]
    spread = (share @ covariance.reshape(len(covariance), -1)).reshape(mixture.covariance.shape)
    spread += (deviation * share[:, :, None]).transpose(0, 2, 1) @ deviation
    exchanged = joint[: len(weight)].copy()
    np.add.at(exchanged, ending.sources[: len(joint) - len(weight)], joint[len(weight) :])
    return Mixture(mean, spread, weight), share, exchanged / mixture.weight[:, None]


def _conditioned(mixture: Mixture, ending: Ending) -> tuple[Mixture, Array]:
    """Return what may end as it is where the state is zero, and how probable that is, 1 where it is certain, shape (k,)."""
    x, covariance = mixture.state[ending.sources], mixture.covariance[ending.sources]
    column = covariance[:, :, ending.state]
    total = column[:, ending.state] + ending.variance
    gain = column / total[:, None]
    value = x[:, ending.state]
    overlap = np.sqrt(ending.variance / total) * np.exp(-0.5 * value**2 / total)
    after = covariance - gain[:, :, None] * column[:, None]
    return Mixture(x - gain * value[:, None], after, mixture.weight[ending.sources]), overlap
