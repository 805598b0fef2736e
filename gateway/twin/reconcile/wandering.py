"""Samples lost without a trace in the time stamps: the recording's time runs behind true time by whole samples, at random.

True time by recorded time is then a line plus a random walk whose steps are one sample. The walk is estimated from how the
readings change with time: least squares with the walk's own spread as prior (a Kalman smoother written as one linear system).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.observations import Observations
from gateway.twin.reconcile.shooting import HEADING
from gateway.twin.reconcile.spectrum import MachineLine, machine_line
from gateway.twin.simulator import Simulator

Array = NDArray[np.float64]
EVERY = 5
"""Samples from knot to knot of the walk."""
ROUNDS = 6
COUNTED_ROUNDS = 4
REACH = 12
"""Samples on each side of the estimated walk among which the path is looked for."""
SLOW_HZ = 5.0
"""What a swing does is slower; a machine's line above would shake the estimate."""


@dataclass(frozen=True, slots=True)
class Walk:
    """True time of each sample, and what is left with it."""

    true_s: Array
    """Shape (n,), rising, 0 at the first sample."""
    fraction: float
    """Of the samples that are missing."""
    reduced: float
    """Chi-square left, reduced."""
    wander: float
    """Cost of the walk under its own spread over the number of its steps that the readings tell: about 1 for a true one."""
    values: Array
    """Start and effects' values."""

    def retimed(self, observations: Observations) -> Observations:
        """The recording at its true times."""
        return replace(observations, time_s=self.true_s)


def find_walk(simulator: Simulator, values: Array, observations: Observations, fraction: float) -> Walk | None:
    """Fit initial motion and walk, from a mean part of lost samples; the simulator has no clock effect.

    None where it runs away: the readings are of another motion.
    """
    o = observations
    dt = float(np.median(np.diff(o.time_s)))
    knots = np.arange(0, len(o.time_s) + EVERY, EVERY)
    left, share = np.arange(len(o.time_s)) // EVERY, (np.arange(len(o.time_s)) % EVERY) / EVERY
    walk = np.zeros(len(knots))
    values = values.copy()
    for turn in range(ROUNDS):
        line_s = o.time_s / (1 - fraction)
        true_s = _rising(line_s + walk[left] * (1 - share) + walk[left + 1] * share, dt)
        lin = simulator.linearise(values, true_s, o.temperature_c)
        residual = o.residual_sigma(lin.force_g)
        if turn == ROUNDS - 1:
            break
        by_time = np.gradient(lin.force_g, true_s, axis=0) / o.noise_g * o.used[:, None]
        by_start = lin.jacobian[:, :, :HEADING] * (o.used[:, None] / o.noise_g)[:, :, None]
        spread = max(fraction, 1e-3) * EVERY * dt**2
        start_step, walk = _solved(slow(residual, dt), by_time, by_start, walk, left, share, spread)
        if not (np.isfinite(walk).all() and np.isfinite(start_step).all()):
            return None
        values[:HEADING] += start_step
        slope = float(np.polyfit(line_s[knots[:-1]], walk[:-1], 1)[0])
        fraction = 1 - (1 - fraction) / (1 + slope)  # the line takes the walk's mean drift
        walk = walk - slope * np.append(line_s[knots[:-1]], line_s[-1])
        walk -= walk[0]
    told = _told(by_time, left, share, spread, len(walk))
    wander = float((np.diff(walk) ** 2).sum() / spread / max(told, 1.0))
    reduced = float((residual**2).sum() / o.count)
    return Walk(true_s - true_s[0], fraction, reduced, wander, values)


def _told(by_time: Array, left: NDArray[np.int64], share: Array, spread: float, count: int) -> float:
    """Number of the walk's steps that the readings tell: the trace of what they add to the prior (MacKay 1992)."""
    matrix = _by_knots((by_time**2).sum(axis=1), left, share, count) + _prior(count, spread)
    return count - 1 - float(np.trace(np.linalg.solve(matrix[1:, 1:], _prior(count, spread)[1:, 1:])))


def _by_knots(square: Array, left: NDArray[np.int64], share: Array, count: int) -> Array:
    """Sums over samples that each touch two knots, shape (count, count)."""
    matrix = np.zeros((count, count))
    sides = ((left, 1 - share), (left + 1, share))
    for place, weight in sides:
        for other, by in sides:
            np.add.at(matrix, (place, other), weight * by * square)
    return matrix


def _prior(count: int, spread: float) -> Array:
    """Of independent steps, shape (count, count)."""
    steps = np.diff(np.eye(count), axis=0)
    prior: Array = steps.T @ steps / spread
    return prior


def slow(residual: Array, dt: float) -> Array:
    """What is below `SLOW_HZ`, shape (n, 3)."""
    transform = np.fft.rfft(residual, axis=0)
    transform[np.fft.rfftfreq(len(residual), dt) > SLOW_HZ] = 0
    return np.fft.irfft(transform, len(residual), axis=0)


def _rising(true_s: Array, dt: float) -> Array:
    """Times at least a tenth of a sample apart."""
    steps = np.maximum(np.diff(true_s), 0.1 * dt)
    return np.concatenate([true_s[:1], true_s[0] + np.cumsum(steps)])


def _solved(
    residual: Array, by_time: Array, by_start: Array, walk: Array, left: NDArray[np.int64], share: Array, spread: float
) -> tuple[Array, Array]:
    """Step of the start and the new walk, by least squares with the prior on the walk's steps."""
    count, k = len(walk), by_start.shape[2]
    flat = by_start.reshape(-1, k)
    # Samples to knots: each touches two.
    weights = np.stack([1 - share, share], axis=1)
    places = np.stack([left, left + 1], axis=1)
    design_time = np.zeros((count, k))
    right = np.zeros(count)
    square = (by_time**2).sum(axis=1)
    along = np.einsum("ni,nik->nk", by_time, by_start)
    pulled = (by_time * residual).sum(axis=1)
    now = walk[left] * weights[:, 0] + walk[left + 1] * weights[:, 1]
    for a in range(2):
        np.add.at(design_time, places[:, a], weights[:, [a]] * along)
        np.add.at(right, places[:, a], weights[:, a] * (pulled + square * now))
    matrix = _by_knots(square, left, share, count) + _prior(count, spread)
    matrix[0, 0] += 1e12  # the walk begins at 0
    whole = np.block([[flat.T @ flat, design_time.T], [design_time, matrix]])
    solved = np.linalg.solve(
        whole, np.concatenate([flat.T @ residual.ravel() + (along * now[:, None]).sum(axis=0), right])
    )
    return solved[:k], solved[k:]


def counted(simulator: Simulator, walk: Walk, observations: Observations) -> Walk:
    """The walk in whole samples: which were lost, by the most likely path (Viterbi 1967), with a machine's line if there is one.

    The line's phase tells a lost sample where the swing alone cannot.
    """
    o = observations
    dt = float(np.median(np.diff(o.time_s)))
    rows = np.arange(len(o.time_s))
    lost = np.maximum.accumulate(np.round(walk.true_s / dt - rows)).astype(np.int64)
    values, fraction, line = walk.values.copy(), walk.fraction, None
    for turn in range(COUNTED_ROUNDS):
        true_s = np.asarray(walk.true_s if turn == 0 else (rows + lost) * dt, dtype=np.float64)
        lin = simulator.linearise(values, true_s, o.temperature_c)
        if turn:
            by_start = (lin.jacobian[:, :, :HEADING] * (o.used[:, None] / o.noise_g)[:, :, None]).reshape(-1, HEADING)
            residual = o.residual_sigma(lin.force_g + _shaking(line, true_s)).ravel()
            values[:HEADING] += np.linalg.lstsq(by_start, residual, rcond=None)[0]
        line = machine_line(true_s, o.force_g - simulator.predict(values, true_s, o.temperature_c), o.noise_g)
        grid_s = np.arange(lost[-1] + len(rows) + REACH + 1) * dt
        force_g = simulator.predict(values, grid_s) + _shaking(line, grid_s)
        lost = _most_likely(o, force_g, lost, max(fraction, 1e-3))
        fraction = float(lost[-1] / (lost[-1] + len(rows)))
    true_s = np.asarray((rows + lost) * dt, dtype=np.float64)
    force_g = simulator.predict(values, true_s, o.temperature_c) + _shaking(line, true_s)
    reduced = float((o.residual_sigma(force_g) ** 2).sum() / o.count)
    return replace(walk, true_s=true_s, fraction=fraction, reduced=reduced, values=values)


def _most_likely(o: Observations, force_g: Array, near: NDArray[np.int64], fraction: float) -> NDArray[np.int64]:
    """How many samples were lost before each, within `REACH` of an estimate; force_g on the even grid of all samples."""
    offsets = np.arange(-REACH, REACH + 1)
    step_cost = -2 * np.log([1 - fraction, fraction, fraction**2, fraction**3])
    cost = np.where(near[0] + offsets == 0, 0.0, np.inf)
    came = np.zeros((len(near), len(offsets)), dtype=np.int64)
    rows = np.arange(len(near))
    states = np.clip(rows[:, None] + near[:, None] + offsets, 0, len(force_g) - 1)
    misfit = (((o.force_g[:, None] - force_g[states]) / o.noise_g) ** 2).sum(axis=2) * o.used[:, None]
    misfit[(near[:, None] + offsets) < 0] = np.inf
    for i in range(1, len(near)):
        # State s now was s + shift - lost before, the window having moved by `shift`.
        shift = int(near[i] - near[i - 1])
        padded = np.concatenate([np.full(8, np.inf), cost, np.full(8 + max(0, shift), np.inf)])
        tried = np.stack([padded[8 + shift - j : 8 + shift - j + len(offsets)] + step_cost[j] for j in range(4)])
        came[i] = np.argmin(tried, axis=0)
        cost = tried[came[i], np.arange(len(offsets))] + misfit[i]
    state = int(np.argmin(cost))
    found = np.empty(len(near), dtype=np.int64)
    for i in range(len(near) - 1, -1, -1):
        found[i] = near[i] + offsets[state]
        if i:
            state = int(state + (near[i] - near[i - 1]) - came[i, state])
    return found


def _shaking(line: MachineLine | None, true_s: Array) -> Array:
    if line is None:
        return np.zeros((len(true_s), 3))
    shaking: Array = (line.phasors_g * np.exp(2j * np.pi * line.frequency_hz * true_s)[:, None]).real
    return shaking
