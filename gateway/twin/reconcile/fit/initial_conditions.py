"""Initial guesses of the initial conditions of each segment, by a fit of that segment alone."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import ModelStructure
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.levenberg_marquardt import REFINEMENT_ITERATIONS, NormalEquations
from gateway.twin.reconcile.fit.windowed_fit import initial_state_from_samples
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, horizontal_pairs

Array = NDArray[np.float64]
LOCAL_DAMPING = 1e-4
"""Levenberg-Marquardt factor on the scaled diagonal, for segments that do not determine the whole initial state."""
MAX_LOCAL_STEP = 0.7
"""Largest step of an angle or a rate, rad and rad/s."""


def segment_initial_conditions(
    simulator: Simulator, observations: Observations, effect_values: Array, first_samples: list[int]
) -> Array:
    """Return an initial state for each segment from the samples of that segment alone, shape (segments, states).

    The samples of one segment do not determine its heading. It is set so that the headings of consecutive segments agree.
    """
    n_states = simulator.n_initial_states
    initial_states = np.zeros((len(first_samples), n_states))
    if observations.has_large_amplitude:
        initial_states = initial_state_from_samples(simulator.rig, observations, first_samples, n_states)
    free = np.arange(n_states) != HEADING
    weight = (observations.used[:, None] / observations.noise_g)[:, :, None]
    turns_rad = np.zeros(len(first_samples))
    for _ in range(REFINEMENT_ITERATIONS):
        batch = simulator.linearise_segments(
            initial_states, effect_values, observations.time_s, first_samples, observations.temperature_c
        )
        residual, jacobian = observations.residual_sigma(batch.force_g), batch.force_by_start * weight
        for i, (first, last) in enumerate(pairwise([*first_samples, len(residual)])):
            equations = NormalEquations.from_jacobian(jacobian[first:last], residual[first:last])
            initial_states[i] += np.clip(equations.step(free, LOCAL_DAMPING), -MAX_LOCAL_STEP, MAX_LOCAL_STEP)
        turns_rad = batch.ends[:, HEADING]
    turned_rad = np.concatenate([[0.0], np.cumsum(turns_rad[:-1])])
    return rotate_about_vertical(initial_states, turned_rad, simulator.structure)


def rotate_about_vertical(initial_states: Array, angle_rad: Array, structure: ModelStructure) -> Array:
    """Return initial states (segments, states) in a world rotated about the vertical; they give the same samples."""
    rotated = initial_states.copy()
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    for pair in horizontal_pairs(structure):
        x, y = initial_states[:, pair].T
        rotated[:, pair] = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
    rotated[:, HEADING] += angle_rad
    return rotated
