"""Gaussians with weights, one for each hypothesis, and how they exchange probability (Blom and Bar-Shalom 1988)."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array


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


def exchange(mixture: Mixture, transition: Array) -> tuple[Mixture, Array]:
    """Return the mixture after the hypotheses have exchanged probability, and what each (row) took from each, shape (m, m).

    `transition`: probabilities from row to column, shape (m, m).
    """
    joint = mixture.weight[:, None] * transition
    weight = joint.sum(axis=0)
    share = (joint / weight).T
    state = share @ mixture.state
    deviation = mixture.state - state[:, None]
    covariance = (share @ mixture.covariance.reshape(len(weight), -1)).reshape(mixture.covariance.shape)
    covariance += (deviation * share[:, :, None]).transpose(0, 2, 1) @ deviation
    return Mixture(state, covariance, weight), share
