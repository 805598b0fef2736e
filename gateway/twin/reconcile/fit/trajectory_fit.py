"""The fit of a recording as one trajectory, whatever the amplitude."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.levenberg_marquardt import FIT_ITERATIONS
from gateway.twin.reconcile.fit.multiple_shooting import fit_model
from gateway.twin.reconcile.fit.prior import NormalPrior
from gateway.twin.reconcile.fit.reparameterisation import NO_LIMITS, Limits
from gateway.twin.reconcile.fit.windowed_fit import fit_windows
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
LARGE_AMPLITUDE_ITERATIONS = 30
"""Iterations of a fit of a large swing: its period depends on every parameter, and its segments join slowly."""
STATE_SCALES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
"""Factors on an initial state, for a model that decays too slowly to follow the recording from the true one."""


def fit_trajectory(
    simulator: Simulator,
    observations: Observations,
    initial_states: Array,
    effect_values: Array,
    free: NDArray[np.bool_],
    first_samples: Sequence[int],
    iterations: int,
    tick: Callable[[], None] = lambda: None,
    give_up_above: float = np.inf,
    limits: Limits = NO_LIMITS,
    prior: NormalPrior | None = None,
) -> Fit:
    """Fit as `fit_model` does; a large swing first in windows.

    Where the segments of a large swing cannot be joined, the result is a single trajectory near the recording.
    """
    fit_from = partial(fit_model, simulator, observations, free=free, tick=tick, prior=prior)
    if not observations.has_large_amplitude:
        return fit_from(
            initial_states,
            effect_values,
            first_samples=first_samples,
            iterations=iterations,
            give_up_above=give_up_above,
            limits=limits,
        )
    free_effects = free[simulator.n_initial_states :]
    initial_states, effect_values, _ = fit_windows(
        simulator, observations, initial_states, effect_values, free_effects, first_samples, tick, prior
    )
    iterations = max(iterations, LARGE_AMPLITUDE_ITERATIONS)
    try:
        fit = fit_from(
            initial_states,
            effect_values,
            first_samples=first_samples,
            iterations=iterations,
            give_up_above=give_up_above,
        )
        if np.isfinite(fit.chi2):
            return fit
    except np.linalg.LinAlgError:
        pass
    initial_state = _best_scaled_state(simulator, observations, initial_states[0], effect_values)
    return fit_from(initial_state[None], effect_values, first_samples=[0], iterations=FIT_ITERATIONS)


@np.errstate(over="ignore", invalid="ignore")  # a trajectory that diverges is not the best
def _best_scaled_state(
    simulator: Simulator, observations: Observations, initial_state: Array, effect_values: Array
) -> Array:
    """Return the multiple of an initial state whose trajectory has the least chi-square."""
    tried = []
    for factor in STATE_SCALES:
        scaled = np.where(np.arange(len(initial_state)) == HEADING, initial_state, factor * initial_state)
        values = np.concatenate([scaled, effect_values])
        force_g = simulator.predict(values, observations.time_s, observations.temperature_c)
        chi2 = observations.chi2(force_g)
        tried.append((chi2 if np.isfinite(chi2) else np.inf, scaled))
    return min(tried, key=lambda each: each[0])[1]
