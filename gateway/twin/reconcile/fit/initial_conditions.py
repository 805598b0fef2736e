"""The initial motion: found piece by piece from the readings, then as one motion over the whole recording."""

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import ModelStructure
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.multiple_shooting import Fit, fit_model, uniform_segments
from gateway.twin.reconcile.fit.windowed_fit import initial_state_from_samples
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, horizontal_pairs

Array = NDArray[np.float64]
LOCAL_ITERATIONS = 3


def segment_initial_conditions(
    simulator: Simulator, observations: Observations, effects: Array, firsts: list[int]
) -> Array:
    """A start for each segment from that segment's readings alone, shape (segments, starts).

    The directions of later segments are turned so that headings go on from segment to segment.
    """
    starts = np.zeros((len(firsts), simulator.n_initial_states))
    if observations.has_large_amplitude:
        starts = initial_state_from_samples(simulator.rig, observations, firsts, simulator.n_initial_states)
    weight = observations.used[:, None] / observations.noise_g
    turns = np.zeros(len(firsts))
    for _ in range(LOCAL_ITERATIONS):
        found = simulator.linearise_segments(starts, effects, observations.time_s, firsts, observations.temperature_c)
        residual = observations.residual_sigma(found.force_g)
        for i, (first, last) in enumerate(zip(firsts, [*firsts[1:], len(residual)], strict=True)):
            by = found.force_by_start[first:last] * weight[first:last, :, None]
            by[..., HEADING] = 0.0
            starts[i] += _damped_step(by.reshape(-1, simulator.n_initial_states), residual[first:last].ravel())
        turns = found.ends[:, HEADING]
    return rotate_about_vertical(starts, np.concatenate([[0.0], np.cumsum(turns[:-1])]), simulator.structure)


def rotate_about_vertical(starts: Array, by_rad: Array, structure: ModelStructure) -> Array:
    """Starts (segments, starts) seen from a world turned about the vertical: the same readings, other directions and headings."""
    found = starts.copy()
    cos, sin = np.cos(by_rad), np.sin(by_rad)
    for pair in horizontal_pairs(structure):
        x, y = starts[:, pair].T
        found[:, pair] = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
    found[:, HEADING] += by_rad
    return found


def _damped_step(flat: Array, residual: Array) -> Array:
    normal = flat.T @ flat
    scale = np.sqrt(np.diag(normal)) + 1e-9
    matrix = normal / np.outer(scale, scale) + 1e-4 * np.eye(len(scale))
    step: Array = np.linalg.solve(matrix, flat.T @ residual / scale) / scale
    return np.clip(step, -0.7, 0.7)


def free_values(simulator: Simulator, *, heading: bool, held: frozenset[str] = frozenset()) -> NDArray[np.bool_]:
    """All values that are fitted: the heading only where directions of the world are told apart by it."""
    return np.array(
        [(heading if slot.parameter == "heading_rad" else slot.label not in held) for slot in simulator.parameters]
    )


def fit_nuisances(simulator: Simulator, observations: Observations, effects: Array) -> tuple[Fit, Array]:
    """Only the initial motion is fitted, the effects' values stay; also returns the starts piece by piece."""
    firsts = uniform_segments(observations)
    starts = segment_initial_conditions(simulator, observations, effects, firsts)
    free = np.zeros(len(simulator.parameters), dtype=bool)
    free[: simulator.n_initial_states] = True
    free[HEADING] = False
    return fit_model(simulator, observations, starts, effects, free, firsts), starts
