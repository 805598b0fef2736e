"""The step of the interacting multiple models in which hypotheses exchange probability (Blom and Bar-Shalom 1988).

A transition carries the state of its source to its target: states that begin to act get variance, states that end are conditioned
on zero, so that what ends (a drive, a hoist) also tells about what it leaves behind. Each target keeps the mean and covariance of
the mixture that reaches it.
"""

from dataclasses import dataclass

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES, Transition
from gateway.motion.state_vector import HOIST_ACCELERATION, HOIST_SPEED, INPUT, INPUT_RATE, N_STATES
from gateway.numerics.array import Array

ANY_VALUE = 1e3
"""Standard deviation by which a state that ends from any value tells nothing about what it leaves behind."""
SMALLEST_WEIGHT = 1e-200
"""Keeps weights positive; a hypothesis revives by transitions from the others alone."""
FORGOTTEN = 1e-60
"""Weight below which a hypothesis is not revived by transitions."""
ACTING = [*range(INPUT.start, INPUT_RATE.stop), HOIST_SPEED, HOIST_ACCELERATION]
"""States that a hypothesis has or has not."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """State and covariance under each hypothesis, with its weight: shapes (m, n), (m, n, n) and (m,)."""

    state: Array
    covariance: Array
    weight: Array


def revive(mixture: Mixture, prior: Mixture) -> Mixture:
    """Return the mixture in which a forgotten hypothesis follows the most probable one, with the prior of what it lets act.

    Left alone, its motion would leave the domain of the equations.
    """
    forgotten = mixture.weight < FORGOTTEN
    if not forgotten.any():
        return mixture
    best = mixture.weight.argmax()
    state, covariance = mixture.state.copy(), mixture.covariance.copy()
    state[forgotten], covariance[forgotten] = mixture.state[best], mixture.covariance[best]
    rows = np.flatnonzero(forgotten)[:, None]
    state[rows, ACTING] = prior.state[rows, ACTING]
    covariance[rows, ACTING], covariance[rows, :, ACTING] = 0.0, 0.0
    covariance[rows, ACTING, ACTING] = prior.covariance[rows, ACTING, ACTING]
    return Mixture(state, covariance, mixture.weight)


class Exchange:
    """The transitions of a filter.

    A state that begins to act only gets variance, so that these transitions carry the mixture's own Gaussians. Only where states
    end, a transition has a Gaussian of its own.
    """

    def __init__(self, transitions: tuple[Transition, ...], n_states: int = N_STATES) -> None:
        beginning = [t for t in transitions if not t.zeroed]
        self._endings = tuple(_Ending.of(group) for group in _by_zeroed_states(transitions))
        ending = [t for group in _by_zeroed_states(transitions) for t in group]
        ordered = [*beginning, *ending]
        self._rates_1_s = np.array([t.rate_1_s for t in ordered])
        self._sources = np.array([t.source for t in ordered])
        self._ending_sources = np.array([t.source for t in ending])
        self._n_beginning, self._n_components = len(beginning), N_HYPOTHESES + len(ending)
        self._opened = np.zeros((len(beginning), n_states))
        self._opened[:, :N_STATES] = [t.opened for t in beginning]
        self._opened_target = np.zeros((N_HYPOTHESES, len(beginning)))
        self._opened_target[[t.target for t in beginning], np.arange(len(beginning))] = 1.0
        targets = np.array([*range(N_HYPOTHESES), *(t.target for t in ordered)])
        components = [*range(N_HYPOTHESES), *(t.source for t in beginning), *range(N_HYPOTHESES, self._n_components)]
        self._place = targets * self._n_components + np.array(components)
        """Of each weight in the matrix of targets and components: those that stay, then those carried."""

    def after(self, mixture: Mixture, time_s: float) -> Mixture:
        """Return the mixture after the transitions of a time step."""
        states = np.concatenate([mixture.state, mixture.state[self._ending_sources]])
        covariances = np.concatenate([mixture.covariance, mixture.covariance[self._ending_sources]])
        carried = -np.expm1(-time_s * self._rates_1_s) * mixture.weight[self._sources]
        begin = N_HYPOTHESES
        for ending in self._endings:
            these = slice(begin, begin + len(ending.noise))
            transition = these.start - N_HYPOTHESES + self._n_beginning
            carried[transition : transition + len(ending.noise)] *= ending.condition(states[these], covariances[these])
            begin = these.stop
        leaving = np.bincount(self._sources, carried, minlength=N_HYPOTHESES)
        stay = np.maximum(mixture.weight - leaving, SMALLEST_WEIGHT)
        all_weights = np.concatenate([stay, carried])
        counted = np.bincount(self._place, all_weights, minlength=N_HYPOTHESES * self._n_components)
        shares: Array = counted.astype(np.float64).reshape(N_HYPOTHESES, -1)
        weight = shares.sum(axis=1)
        shares /= weight[:, None]
        state, covariance = _moments(shares, states, covariances)
        opened = self._opened_target @ (carried[: self._n_beginning, None] * self._opened)
        covariance.reshape(N_HYPOTHESES, -1)[:, :: opened.shape[1] + 1] += opened / weight[:, None]
        return Mixture(state, covariance, weight / weight.sum())


@dataclass(frozen=True, slots=True)
class _Ending:
    """Transitions after which the same states are zero."""

    zeroed: slice
    noise: Array
    """Covariance of their deviation from zero at the end, shape (transitions, zeroed states, zeroed states)."""
    counts_spread: bool

    @classmethod
    def of(cls, transitions: list[Transition]) -> "_Ending":
        zeroed = transitions[0].zeroed
        tolerance = [t.tolerance or (ANY_VALUE,) * len(zeroed) for t in transitions]
        noise = np.square(tolerance)[:, :, None] * np.eye(len(zeroed))
        return cls(slice(zeroed[0], zeroed[-1] + 1), noise, transitions[0].counts_spread)

    def condition(self, states: Array, covariances: Array) -> Array:
        """Condition Gaussians on zero, in place; return how well that agrees with what was known of them, 0 to 1.

        `states`, `covariances`: shapes (transitions, n) and (transitions, n, n).
        """
        zeroed = self.zeroed
        rows, values = covariances[:, zeroed], states[:, zeroed]
        spread = rows[:, :, zeroed] + self.noise
        inverse: Array = np.asarray(np.linalg.inv(spread), dtype=np.float64)
        gain = inverse @ rows
        share: Array = np.exp(-0.5 * np.vecdot(values, np.matvec(inverse, values)))
        if self.counts_spread:
            share *= np.sqrt(np.linalg.det(self.noise) / np.linalg.det(spread))
        states -= np.vecmat(values, gain)
        covariances -= rows.transpose(0, 2, 1) @ gain
        states[:, zeroed] = covariances[:, zeroed] = covariances[:, :, zeroed] = 0.0
        return share


def _by_zeroed_states(transitions: tuple[Transition, ...]) -> list[list[Transition]]:
    groups: dict[tuple[int, ...], list[Transition]] = {}
    for transition in transitions:
        if transition.zeroed:
            groups.setdefault(transition.zeroed, []).append(transition)
    return list(groups.values())


def _moments(shares: Array, states: Array, covariances: Array) -> tuple[Array, Array]:
    """Return mean and covariance of mixtures of the same Gaussians.

    `shares`, shape (m, k): of each Gaussian in each mixture; `states`, shape (k, n); `covariances`, shape (k, n, n).
    """
    state = shares @ states
    deviation = states - state[:, None]
    covariance = (shares @ covariances.reshape(len(covariances), -1)).reshape(len(shares), *covariances.shape[1:])
    covariance += (deviation * shares[:, :, None]).transpose(0, 2, 1) @ deviation
    return state, covariance
