"""The fit of a recording as one trajectory; of a large swing first in windows with an initial state each (variable projection).

A model without the right losses cannot follow a swing that decays, and a fit that begins with continuity constraints diverges.
Without them, the initial state of each window is eliminated, and the change of the samples within the windows determines the
effects (Golub and Pereyra 1973).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.least_squares import (
    FIT_ITERATIONS,
    LARGE_SWING_ITERATIONS,
    Fit,
    FitProblem,
    NormalPrior,
)
from gateway.twin.reconcile.fit.multiple_shooting import fit_model
from gateway.twin.reconcile.fit.reparameterisation import effect_bounds
from gateway.twin.simulator.compiled_model import IntegrationError
from gateway.twin.simulator.simulator import SegmentBatch
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
STEP_FRACTIONS = (1.0, 0.3, 0.1)
"""Fractions of a step that are tried in turn until chi-square falls."""
RANK_TOLERANCE = 1e-5
"""Singular value, relative to the largest, below which samples do not determine a combination of values, such as the azimuth of a
swing seen at the load."""
MIN_RELATIVE_GAIN = 1e-3
"""A windowed fit ends when a step lowers chi-square by less than this share; it only has to start the next fit."""
STATE_SCALES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
"""Factors on an initial state, for a model that decays too slowly to follow the recording from the true one."""


@dataclass(frozen=True, slots=True)
class FitWindow:
    """The linearisation of one window, in sigma; the heading is left out, because samples do not determine it."""

    by_state: Array
    """Derivatives by the initial state, shape (rows, states - 1)."""
    by_effects: Array
    """Derivatives by the effect values, shape (rows, effect values)."""
    residual: Array
    """Shape (rows,)."""

    def project_out_initial_state(self) -> tuple[Array, Array]:
        """Return the derivatives by the effect values and the residual, orthogonal to those by the initial state."""
        basis = np.linalg.qr(self.by_state)[0]
        by_effects = self.by_effects - basis @ (basis.T @ self.by_effects)
        residual = self.residual - basis @ (basis.T @ self.residual)
        return np.asarray(by_effects, dtype=np.float64), np.asarray(residual, dtype=np.float64)

    def state_step(self, effect_step: Array) -> Array:
        """Return the step of the whole initial state (states,) that goes with a step of the effect values."""
        remaining = self.residual - self.by_effects @ effect_step
        step = np.linalg.lstsq(self.by_state, remaining, rcond=RANK_TOLERANCE)[0]
        return np.asarray(np.insert(step, HEADING, 0.0), dtype=np.float64)


def split_windows(batch: SegmentBatch, observations: Observations, first_samples: Sequence[int]) -> list[FitWindow]:
    """Return the windows of a linearisation."""
    weight = observations.per_sigma[..., None]
    by_state = np.delete(batch.force_by_start, HEADING, axis=2) * weight
    by_effects, residual = batch.force_by_effects * weight, observations.residual_sigma(batch.force_g)
    return [
        FitWindow(
            by_state[first:last].reshape(3 * (last - first), -1),
            by_effects[first:last].reshape(3 * (last - first), -1),
            residual[first:last].ravel(),
        )
        for first, last in pairwise([*first_samples, len(residual)])
    ]


@np.errstate(over="ignore", invalid="ignore")  # a step to trajectories that diverge is not taken
def fit_windows(problem: FitProblem, initial_states: Array, effect_values: Array) -> tuple[Array, Array, SegmentBatch]:
    """Return the fitted initial states (windows, states) and effect values (k,), and the linearisation there.

    The free effect values are fitted, inside their bounds, by Gauss-Newton with the initial states eliminated. Raises
    `LinAlgError` as the solver does, and `IntegrationError` where the windows diverge.
    """
    simulator, observations, first_samples = problem.simulator, problem.observations, problem.first_samples
    time_s, temperature_c = observations.time_s, observations.temperature_c
    batch = simulator.linearise_segments(initial_states, effect_values, time_s, first_samples, temperature_c)
    if not batch.is_finite:
        raise IntegrationError("the trajectories of the windows diverge from these values")
    known = problem.prior().of_effects(simulator.n_initial_states)
    chi2 = observations.chi2(batch.force_g) + known.chi2(effect_values)
    for _ in range(FIT_ITERATIONS):
        windows = split_windows(batch, observations, first_samples)
        effect_step = _effect_step(problem, windows, effect_values, known)
        state_steps = np.array([window.state_step(effect_step) for window in windows])
        gain = 0.0
        for fraction in STEP_FRACTIONS:
            problem.tick()
            states_after = initial_states + fraction * state_steps
            effects_after = effect_values + fraction * effect_step
            after = simulator.linearise_segments(states_after, effects_after, time_s, first_samples, temperature_c)
            left = observations.chi2(after.force_g) + known.chi2(effects_after)
            gain = chi2 - left if after.is_finite else 0.0
            if gain > 0:
                initial_states, effect_values, batch, chi2 = states_after, effects_after, after, chi2 - gain
                break
        if not gain > MIN_RELATIVE_GAIN * chi2:
            break
    return initial_states, effect_values, batch


def project_out_initial_states(windows: Sequence[FitWindow]) -> tuple[Array, Array]:
    """Return the effects' columns (3 n, k) and the residual (3 n,) in sigma, without what the initial states explain."""
    projected = map(FitWindow.project_out_initial_state, windows)
    by_effects, residual = (np.concatenate(each) for each in zip(*projected, strict=True))
    return by_effects, residual


def _effect_step(problem: FitProblem, windows: Sequence[FitWindow], effect_values: Array, prior: NormalPrior) -> Array:
    """Return the Gauss-Newton step of the free effect values, cut at their bounds, shape (k,)."""
    simulator = problem.simulator
    free = problem.free[simulator.n_initial_states :]
    step = np.zeros(len(effect_values))
    if not free.any():
        return step
    by_effects, residual = project_out_initial_states(windows)
    weight = np.sqrt(prior.precision)
    by_effects = np.concatenate([by_effects, np.diag(weight)])
    residual = np.concatenate([residual, weight * (prior.centre - effect_values)])
    step[free] = np.linalg.lstsq(by_effects[:, free], residual, rcond=RANK_TOLERANCE)[0]
    lower, upper = effect_bounds(simulator, problem.limits)
    inside: Array = np.clip(effect_values + step, lower, upper) - effect_values
    return inside


def fit_trajectory(
    problem: FitProblem,
    initial_states: Array,
    effect_values: Array,
    iterations: int,
    give_up_above: float = np.inf,
) -> Fit:
    """Fit as `fit_model` does; a large swing first in windows.

    Where the segments of a large swing cannot be joined, the result is a single trajectory near the recording.
    """
    if not problem.observations.has_large_amplitude:
        return fit_model(problem, initial_states, effect_values, iterations, give_up_above)
    initial_states, effect_values, _ = fit_windows(problem, initial_states, effect_values)
    try:
        iterations = max(iterations, LARGE_SWING_ITERATIONS)
        fit = fit_model(problem, initial_states, effect_values, iterations, give_up_above)
        if np.isfinite(fit.chi2):
            return fit
    except np.linalg.LinAlgError:
        pass
    initial_state = _best_scaled_state(problem, initial_states[0], effect_values)
    return fit_model(problem.as_one_segment, initial_state[None], effect_values)


@np.errstate(over="ignore", invalid="ignore")  # a trajectory that diverges is not the best
def _best_scaled_state(problem: FitProblem, initial_state: Array, effect_values: Array) -> Array:
    """Return the multiple of an initial state whose trajectory has the least chi-square."""
    simulator, observations = problem.simulator, problem.observations
    tried = []
    for factor in STATE_SCALES:
        scaled = np.where(np.arange(len(initial_state)) == HEADING, initial_state, factor * initial_state)
        values = np.concatenate([scaled, effect_values])
        force_g = simulator.predict(values, observations.time_s, observations.temperature_c)
        chi2 = observations.chi2(force_g)
        tried.append((chi2 if np.isfinite(chi2) else np.inf, scaled))
    return min(tried, key=lambda each: each[0])[1]
