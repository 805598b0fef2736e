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


Pairs = tuple[IndexArray, IndexArray]
"""Hypotheses, and one that follows each; nobody follows two of them. Shapes (k,)."""


@dataclass(frozen=True, slots=True)
class Renewal:
    """Hypotheses between which states are not handed on: they begin anew, at zero."""

    pairs: tuple[Pairs, ...]
    states: slice
    variances: Array
    """Of these states, for each of the pairs."""


@dataclass(frozen=True, slots=True)
class Ending:
    """Hypotheses that end only where one of the states is zero."""

    pairs: tuple[Pairs, ...]
    state: int
    variance: float
    """Of the state once it has ended."""


def exchange(mixture: Mixture, transition: Array, ending: Ending, renewal: Renewal) -> tuple[Mixture, Array, Array]:
    """Return the mixture after the hypotheses have exchanged probability, what each (row) took from each, and the probabilities
    of the exchange, shapes (m, m).

    `transition`: probabilities from row to column, shape (m, m), of an ending one if its state were zero. Without its condition
    an ending would bring all speeds with it, at each step anew, and what has come to rest would never be sure of it.
    """
    joint = mixture.weight[:, None] * transition
    pairs = (*ending.pairs, *renewal.pairs)
    ended = [_conditioned(mixture, pair, ending) for pair in ending.pairs]
    ended += [
        _renewed(mixture, pair, renewal.states, variance)
        for pair, variance in zip(renewal.pairs, renewal.variances, strict=True)
    ]
    ends = [joint[pair] * overlap for pair, (_, overlap) in zip(pairs, ended, strict=True)]
    for pair in pairs:
        joint[pair] = 0.0
    weight = joint.sum(axis=0)
    share = (joint / weight).T
    state = share @ mixture.state
    centre = mixture.weight @ mixture.state  # near to all of them, so that little cancels
    from_centre, to_centre = mixture.state - centre, state - centre
    second = mixture.covariance + from_centre[:, :, None] * from_centre[:, None]
    covariance = (share @ second.reshape(len(weight), -1)).reshape(second.shape)
    covariance -= to_centre[:, :, None] * to_centre[:, None]
    for pair, each, (part, _) in zip(pairs, ends, ended, strict=True):
        _, into = pair
        joint[pair] = each
        weight[into] += each
        taken = each / weight[into]
        apart = part.state - state[into]
        state[into] += taken[:, None] * apart
        spread = part.covariance - covariance[into]
        spread += ((1 - taken)[:, None] * apart)[:, :, None] * apart[:, None]
        covariance[into] += taken[:, None, None] * spread
    total = weight.sum()
    return Mixture(state, covariance, weight / total), (joint / weight).T, joint / total / mixture.weight[:, None]


def _conditioned(mixture: Mixture, pair: Pairs, ending: Ending) -> tuple[Mixture, Array]:
    """Return what may end as it is where the state is zero, and how probable that is, 1 where it is certain, shape (k,)."""
    x, covariance = mixture.state[pair[0]], mixture.covariance[pair[0]]
    column = covariance[:, :, ending.state]
    total = column[:, ending.state] + ending.variance
    gain = column / total[:, None]
    value = x[:, ending.state]
    overlap = np.sqrt(ending.variance / total) * np.exp(-0.5 * value**2 / total)
    after = covariance - gain[:, :, None] * column[:, None]
    return Mixture(x - gain * value[:, None], after, mixture.weight[pair[0]]), overlap


def _renewed(mixture: Mixture, pair: Pairs, states: slice, variance: float) -> tuple[Mixture, Array]:
    """Return what follows with these states unknown but for their variance, and that nothing speaks against it."""
    x, covariance = mixture.state[pair[0]], mixture.covariance[pair[0]]
    x[:, states] = 0.0
    covariance[:, states], covariance[:, :, states] = 0.0, 0.0
    places = np.arange(states.start, states.stop)
    covariance[:, places, places] = variance
    return Mixture(x, covariance, mixture.weight[pair[0]]), np.ones(len(x))
