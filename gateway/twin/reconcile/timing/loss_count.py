"""The number of lost samples before each sample, in whole samples, with the help of a machine's vibration.

The phase of the vibration shows a lost sample where the swing alone does not.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import MachineLine, find_machine_line
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.timing.time_warp import INITIAL_STATES, MIN_LOST_FRACTION, TimeWarp
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
COUNT_ITERATIONS = 4
"""Alternations between the path, the vibration and the initial state."""
SEARCH_SAMPLES = 12
"""Samples on either side of the estimated count among which the path is searched."""
MAX_CONSECUTIVE_LOSSES = 3
"""Largest number of samples lost in one place."""


def viterbi_loss_count(simulator: Simulator, warp: TimeWarp, observations: Observations) -> TimeWarp:
    """Return the time warp in whole samples, by the most likely path (Viterbi 1967)."""
    o, interval_s = observations, observations.interval_s
    rows, positions = np.arange(len(o.time_s)), list(INITIAL_STATES)
    lost = np.maximum.accumulate(np.round(warp.true_s / interval_s - rows)).astype(np.int64)
    values, fraction = warp.values.copy(), warp.fraction
    true_s: Array = warp.true_s
    line: MachineLine | None = None
    for iteration in range(COUNT_ITERATIONS):
        if iteration:
            true_s = np.asarray((rows + lost) * interval_s, dtype=np.float64)
            linear = simulator.linearise(values, true_s, o.temperature_c)
            by_state = (linear.jacobian[:, :, positions] * o.per_sigma[:, :, None]).reshape(-1, len(positions))
            residual = o.residual_sigma(linear.force_g + _vibration_g(line, true_s)).ravel()
            values[positions] += np.linalg.lstsq(by_state, residual, rcond=None)[0]
        line = find_machine_line(true_s, o.force_g - simulator.predict(values, true_s, o.temperature_c), o.noise_g)
        grid_s = np.arange(lost[-1] + len(rows) + SEARCH_SAMPLES + 1) * interval_s
        force_g = simulator.predict(values, grid_s) + _vibration_g(line, grid_s)
        lost = _most_likely_path(o, force_g, lost, max(fraction, MIN_LOST_FRACTION))
        fraction = float(lost[-1] / (lost[-1] + len(rows)))
    true_s = np.asarray((rows + lost) * interval_s, dtype=np.float64)
    force_g = simulator.predict(values, true_s, o.temperature_c) + _vibration_g(line, true_s)
    return replace(warp, true_s=true_s, fraction=fraction, reduced=o.reduced_chi2(force_g), values=values)


def _most_likely_path(observations: Observations, force_g: Array, near: Counts, fraction: float) -> Counts:
    """Return the number of samples lost before each, within `SEARCH_SAMPLES` of an estimate (n,).

    `force_g` is the simulation at all samples, lost ones included, on an even grid.
    """
    o = observations
    offsets = np.arange(-SEARCH_SAMPLES, SEARCH_SAMPLES + 1)
    losses = np.arange(MAX_CONSECUTIVE_LOSSES + 1)
    step_cost = -2 * np.log(np.where(losses == 0, 1 - fraction, fraction**losses))
    cost = np.where(near[0] + offsets == 0, 0.0, np.inf)
    best_losses = np.zeros((len(near), len(offsets)), dtype=np.int64)
    states = np.clip(np.arange(len(near))[:, None] + near[:, None] + offsets, 0, len(force_g) - 1)
    misfit = (((o.force_g[:, None] - force_g[states]) / o.noise_g) ** 2).sum(axis=2) * o.used[:, None]
    misfit[(near[:, None] + offsets) < 0] = np.inf
    for i in range(1, len(near)):
        # State s now was state s + shift - losses before: the search window moved by `shift`.
        shift = int(near[i] - near[i - 1])
        pad = np.full(MAX_CONSECUTIVE_LOSSES, np.inf), np.full(max(0, shift), np.inf)
        padded = np.concatenate([pad[0], cost, pad[1]])
        firsts = MAX_CONSECUTIVE_LOSSES + shift - losses
        tried = np.stack([padded[first : first + len(offsets)] for first in firsts]) + step_cost[:, None]
        best_losses[i] = np.argmin(tried, axis=0)
        cost = tried[best_losses[i], np.arange(len(offsets))] + misfit[i]
    state = int(np.argmin(cost))
    path = np.empty(len(near), dtype=np.int64)
    for i in range(len(near) - 1, -1, -1):
        path[i] = near[i] + offsets[state]
        if i:
            state = int(state + (near[i] - near[i - 1]) - best_losses[i, state])
    return path


def _vibration_g(line: MachineLine | None, true_s: Array) -> Array:
    if line is None:
        return np.zeros((len(true_s), 3))
    signal_g: Array = (line.phasors_g * np.exp(2j * np.pi * line.frequency_hz * true_s)[:, None]).real
    return signal_g
