"""The step of the interacting multiple models in which hypotheses exchange probability (Blom and Bar-Shalom 1988).

A transition carries the state of its source to its target: states that begin to act get variance, states that end are conditioned
on zero, so that what ends (a drive, a hoist) also tells about what it leaves behind. Each target keeps the mean and covariance of
the mixture that reaches it.
"""

from dataclasses import dataclass

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES, Transition
from gateway.motion.state_vector import N_STATES
from gateway.numerics.array import Array

NEGLIGIBLE = 1e-7
"""Probability that a transition must carry to be followed. Basis: what it carries is far below every reported probability."""
SMALLEST_WEIGHT = 1e-200
"""Keeps weights positive; a hypothesis revives by transitions from the others alone."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """State and covariance under each hypothesis, with its weight: shapes (m, n), (m, n, n) and (m,)."""

    state: Array
    covariance: Array
    weight: Array


class Exchange:
    """The transitions of a filter."""

    def __init__(self, transitions: tuple[Transition, ...]) -> None:
        self._transitions = transitions
        self._sources = np.array([t.source for t in transitions])
        self._targets = np.array([t.target for t in transitions])
        self._rates_1_s = np.array([t.rate_1_s for t in transitions])
        self._opened = np.array([t.opened for t in transitions])
        self._kept = np.ones((len(transitions), N_STATES))
        for kept, transition in zip(self._kept, transitions, strict=True):
            kept[list(transition.zeroed)] = 0.0

    def after(self, mixture: Mixture, time_s: float) -> Mixture:
        """Return the mixture after the transitions of a time step."""
        carried = -np.expm1(-self._rates_1_s * time_s) * mixture.weight[self._sources]
        followed = np.flatnonzero(carried > NEGLIGIBLE)
        carried, sources = carried[followed], self._sources[followed]
        states, covariances = mixture.state[sources], mixture.covariance[sources]
        for i, index in enumerate(followed):
            transition = self._transitions[index]
            if transition.tolerance is not None:
                states[i], covariances[i], share = _condition_on_zero(states[i], covariances[i], transition)
                carried[i] *= share
        kept = self._kept[followed]
        states *= kept
        covariances *= kept[:, :, None] * kept[:, None, :]
        covariances.reshape(len(followed), -1)[:, :: N_STATES + 1] += self._opened[followed]
        leaving = np.bincount(sources, carried, minlength=N_HYPOTHESES)
        stay = np.maximum(mixture.weight - leaving, SMALLEST_WEIGHT)
        return _merge(
            np.concatenate([_ALL, self._targets[followed]]),
            np.concatenate([stay, carried]),
            np.concatenate([mixture.state, states]),
            np.concatenate([mixture.covariance, covariances]),
        )


_ALL = np.arange(N_HYPOTHESES)


def _condition_on_zero(state: Array, covariance: Array, transition: Transition) -> tuple[Array, Array, float]:
    """Return the state given that what ends is zero, and how well that agrees with what is known of it, 0 to 1."""
    zeroed, variance = list(transition.zeroed), np.square(transition.tolerance or ())
    rows = covariance[zeroed]
    spread = rows[:, zeroed] + np.diag(variance)
    solved = np.linalg.solve(spread, np.column_stack([rows, state[zeroed]]))
    gain, weighted = solved[:, :-1], solved[:, -1]
    share = float(np.exp(-0.5 * state[zeroed] @ weighted))
    if transition.counts_spread:
        share *= float(np.sqrt(variance.prod() / np.linalg.det(spread)))
    return state - gain.T @ state[zeroed], covariance - gain.T @ rows, share


def _merge(targets: Array, weights: Array, states: Array, covariances: Array) -> Mixture:
    """Return one Gaussian per hypothesis with the moments of the mixture that reaches it."""
    selection = np.zeros((N_HYPOTHESES, len(targets)))
    selection[targets, np.arange(len(targets))] = weights
    weight = selection.sum(axis=1)
    selection /= weight[:, None]
    state = selection @ states
    deviation = states - state[targets]
    second_moment = covariances + deviation[:, :, None] * deviation[:, None, :]
    covariance = (selection @ second_moment.reshape(len(targets), -1)).reshape(-1, N_STATES, N_STATES)
    return Mixture(state, covariance, weight / weight.sum())
