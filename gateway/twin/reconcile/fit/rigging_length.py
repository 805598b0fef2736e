"""The rigging length of a double pendulum, by fits at several fixed lengths (a profile of chi-square)."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.initial_conditions import segment_initial_conditions
from gateway.twin.reconcile.fit.reparameterisation import RIGGING_LENGTH, ModalParameterisation
from gateway.twin.reconcile.fit.trajectory_fit import fit_trajectory
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
PROFILE_ITERATIONS = 5
"""Iterations of each fit; chi-square has then settled enough to rank rigging lengths."""


def profile_rigging_length(
    simulator: Simulator,
    observations: Observations,
    guesses: Sequence[Array],
    free: NDArray[np.bool_],
    first_samples: list[int],
    tick: Callable[[], None],
) -> Array | None:
    """Return the effect values (k,) of the best fit with the rigging length held; None where no guess can be simulated.

    `guesses` are effect values (k,) in the order of their rigging lengths. Rigging and hook compensate for each other in a narrow
    valley, so the lengths of the guesses are tried first, then the length at the minimum of the parabola through the best three.
    """
    rigging = [parameter.label for parameter in simulator.effect_parameters].index(RIGGING_LENGTH)
    n_states = simulator.n_initial_states
    held = free.copy()
    held[n_states + rigging] = False

    def fit_from(effect_values: Array) -> list[Fit]:
        try:
            starts = segment_initial_conditions(simulator, observations, effect_values, first_samples)
            fit = fit_trajectory(
                simulator, observations, starts, effect_values, held, first_samples, PROFILE_ITERATIONS, tick
            )
        except INTEGRATION_FAILURES:
            return []
        return [fit] if np.isfinite(fit.chi2) else []

    fits = [fit for guess in guesses for fit in fit_from(guess)]
    if not fits:
        return None
    log_lengths = np.log([fit.values[n_states + rigging] for fit in fits])
    minimum = _parabolic_minimum(log_lengths, np.array([fit.chi2 for fit in fits]))
    if minimum is not None:
        modal = ModalParameterisation(simulator.rig, simulator.effect_parameters)
        fitted = modal.to_fitted(_best(fits).values[n_states:])
        fitted[rigging] = np.exp(minimum)
        fits += fit_from(modal.to_physical(fitted))
    return _best(fits).values[n_states:]


def _best(fits: Sequence[Fit]) -> Fit:
    return min(fits, key=lambda fit: fit.chi2)


def _parabolic_minimum(at: Array, chi2: Array) -> float | None:
    """Return the minimum of the parabola through the least value and its neighbours; None where that is at an end."""
    k = int(np.argmin(chi2))
    if not 0 < k < len(at) - 1:
        return None
    slopes, middles = np.diff(chi2[k - 1 : k + 2]) / np.diff(at[k - 1 : k + 2]), (at[k - 1 : k + 1] + at[k : k + 2]) / 2
    return float(middles[0] - slopes[0] * (middles[1] - middles[0]) / (slopes[1] - slopes[0]))
