"""The steps of a filter over a recording, and their correction by what came later."""

from dataclasses import dataclass, replace

import numpy as np

from gateway.motion.mixture import Mixture
from gateway.motion.state_vector import LINE, N_MOVING
from gateway.numerics.array import Array

N_KEPT = LINE.start
"""States that are smoothed; the fast oscillation and a gyroscope's constants follow behind."""
KEPT = slice(0, N_KEPT)
JITTER = 1e-9
"""Share of the variances that keeps a covariance invertible where a state is exactly known."""


@dataclass(frozen=True, slots=True)
class Moments:
    """Mean and covariance of the kept states, shapes (k,) and (k, k), and the weights of the hypotheses, shape (m,)."""

    mean: Array
    covariance: Array
    weight: Array

    @classmethod
    def of(cls, mixture: Mixture) -> "Moments":
        """Return the moments over all hypotheses."""
        mean, covariance = mixture.moments()
        return cls(mean[KEPT], covariance[KEPT, KEPT], mixture.weight)


@dataclass(frozen=True, slots=True)
class StepRecord:
    """One prediction: the state before it and after it, and how they belong together."""

    time_s: float | None
    """Of the state before it; None: between two bins."""
    before: Moments
    after: Moments
    cross: Array
    """Covariance of the states before and after, shape (k, k); zero where the motion was forgotten."""
    exchange: Array | None
    """Probability of each hypothesis (column) after each (row); None where the motion was forgotten."""

    @classmethod
    def of(
        cls, time_s: float | None, before: Mixture, mixed: Mixture, after: Mixture, transition: Array, exchange: Array
    ) -> "StepRecord":
        """Return the record of a prediction.

        `mixed`: after the exchange of probability, before the motion: a winch that stopped had no speed; `transition`: of all
        kept states, shape (m, k, k).
        """
        mixed_x, after_x = mixed.state[:, KEPT], after.state[:, KEPT]
        joint = np.tensordot(after.weight, mixed.covariance[:, KEPT, KEPT] @ transition.transpose(0, 2, 1), 1)
        deviation, moved = mixed_x - after.weight @ mixed_x, after_x - after.weight @ after_x
        return cls(
            time_s,
            replace(Moments.of(mixed), weight=before.weight),
            Moments.of(after),
            joint + (after.weight[:, None] * deviation).T @ moved,
            exchange,
        )

    @classmethod
    def forgetting(cls, time_s: float | None, before: Mixture, after: Mixture) -> "StepRecord":
        """Return the record of a gap over which the motion was forgotten."""
        return cls(time_s, Moments.of(before), Moments.of(after), np.zeros((N_KEPT, N_KEPT)), None)

    def corrected(self, later: Moments) -> Moments:
        """Return the state before the step by what is known of the state after it."""
        if self.exchange is None:
            return self.before
        scale = np.sqrt(np.maximum(np.diagonal(self.after.covariance), 1e-30))
        correlation = self.after.covariance / np.multiply.outer(scale, scale) + JITTER * np.eye(N_KEPT)
        gain = np.linalg.solve(correlation, (self.cross / scale).T).T / scale
        mean = self.before.mean + gain @ (later.mean - self.after.mean)
        covariance = self.before.covariance + gain @ (later.covariance - self.after.covariance) @ gain.T
        weight = self.before.weight * (self.exchange @ (later.weight / self.after.weight))
        return Moments(mean, 0.5 * (covariance + covariance.T), weight / weight.sum())


def kept_transition(moving: Array, factor: Array) -> Array:
    """Return the transition of all kept states from that of the moving ones and the factors of the others, shape (m, k, k)."""
    found = np.zeros((len(moving), N_KEPT, N_KEPT))
    found[:, :N_MOVING] = moving[:, :, KEPT]
    places = np.arange(N_MOVING, N_KEPT)
    found[:, places, places] = factor[:, N_MOVING:N_KEPT]
    return found


class StepHistory:
    """The steps of one candidate so far."""

    def __init__(self) -> None:
        self.steps: list[StepRecord] = []
        self.newest: tuple[float, Moments] | None = None
        """Time and state after the newest bin."""

    def smooth(self, count: int | None = None) -> list[tuple[float, Moments]]:
        """Return time and state of the oldest steps, corrected by all later ones, and forget them; None: of all."""
        if self.newest is None:
            return []
        time_s, later = self.newest
        found = [(time_s, later)] if count is None else []
        kept_from = len(self.steps) if count is None else count
        for place in range(len(self.steps) - 1, -1, -1):
            step = self.steps[place]
            later = step.corrected(later)
            if place < kept_from and step.time_s is not None:
                found.append((step.time_s, later))
        del self.steps[:kept_from]
        if count is None:
            self.newest = None
        return found[::-1]
