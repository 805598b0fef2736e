"""Samples lost without a trace in the time stamps: the recording's time runs behind true time by whole samples, at random.

True time by recorded time is then a line plus a random walk whose steps are one sample. The walk is estimated from how the
readings change with time, by least squares with the walk's own spread as prior.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import MachineLine, find_machine_line
from gateway.twin.effects.sensor_output import Quantization
from gateway.twin.reconcile.data.artefact_detectors import quantised_mean
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.timing.time_warp_smoother import (
    KNOT_SPACING_SAMPLES,
    effective_degrees_of_freedom,
    make_knots,
    marginalise_time_warp,
)
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
INITIAL_MOTION = tuple(range(HEADING))
"""What is free of a start: not the heading."""
TIME_WARP_ITERATIONS = 6
LOSS_COUNT_ITERATIONS = 4
VITERBI_REACH_SAMPLES = 12
"""Samples on each side of the estimated walk among which the path is looked for."""
SWING_LOWPASS_HZ = 5.0
"""What a swing does is slower; a machine's line above would shake the estimate."""


@dataclass(frozen=True, slots=True)
class TimeWarp:
    """True time of each sample, and what is left with it."""

    true_s: Array
    """Shape (n,), rising, 0 at the first sample."""
    fraction: float
    """Of the samples that are missing."""
    reduced: float
    """Chi-square left, reduced."""
    normalised_cost: float
    """Cost of the walk under its own spread over the number of its steps that the readings tell: about 1 for a true one."""
    cost: float
    """Chi-square of the walk's steps."""
    values: Array
    """Start and effects' values."""

    def retimed(self, observations: Observations) -> Observations:
        """The recording at its true times."""
        return replace(observations, time_s=self.true_s)


def estimate_time_warp(
    simulator: Simulator,
    values: Array,
    observations: Observations,
    fraction: float,
    free: Sequence[int] = INITIAL_MOTION,
) -> TimeWarp | None:
    """Fit walk, initial motion and what else is free, from a mean part of lost samples; the simulator has no clock effect.

    None where it runs away: the readings are of another motion.
    """
    o, dt = observations, float(np.median(np.diff(observations.time_s)))
    knots, values = make_knots(len(o.time_s)), values.copy()
    walk, beginnings = np.zeros(knots.count), np.arange(knots.count - 1) * KNOT_SPACING_SAMPLES
    for turn in range(TIME_WARP_ITERATIONS):
        line_s = o.time_s / (1 - fraction)
        true_s = _force_increasing(line_s + knots.at_samples(walk), dt)
        force_g, by_time, by_values = linearise_at(simulator, values, o, true_s)
        residual, spread = o.residual_sigma(force_g), step_variance(fraction, dt)
        if turn == TIME_WARP_ITERATIONS - 1:
            break
        equations = marginalise_time_warp(lowpass(residual, dt), by_time, by_values, walk, knots, spread)
        step, _ = equations.solve(free)
        walk = equations.walk(free, step)
        if not (np.isfinite(walk).all() and np.isfinite(step).all()):
            return None
        values[list(free)] = _apply_step(simulator, values, free, step)
        slope = float(np.polyfit(line_s[beginnings], walk[:-1], 1)[0])
        fraction = 1 - (1 - fraction) / (1 + slope)  # the line takes the walk's mean drift
        walk = walk - slope * np.append(line_s[beginnings], line_s[-1])
        walk -= walk[0]
    cost, told = float((np.diff(walk) ** 2).sum() / spread), effective_degrees_of_freedom(by_time, knots, spread)
    reduced = float((residual**2).sum() / o.n_values)
    return TimeWarp(true_s - true_s[0], fraction, reduced, cost / max(told, 1.0), cost, values)


def linearise_at(simulator: Simulator, values: Array, o: Observations, true_s: Array) -> tuple[Array, Array, Array]:
    """A prediction in g, (n, 3), as read; in sigma how it changes with time, (n, 3), and with all values, (n, 3, values).

    With cutoffs by their inverse: a lag is a shift of time, which the initial motion makes up for in proportion.
    """
    lin = simulator.linearise(values, true_s, o.temperature_c)
    weight = o.used[:, None] / o.noise_g
    by_values = lin.jacobian * weight[:, :, None]
    for i in _cutoff_indices(simulator):
        by_values[:, :, i] *= -(values[i] ** 2)
    return (
        quantised_mean_of(simulator, values, lin.force_g),
        np.gradient(lin.force_g, true_s, axis=0) * weight,
        by_values,
    )


def quantised_mean_of(simulator: Simulator, values: Array, force_g: Array) -> Array:
    """In coarse steps their mean: what a lattice does to a swing is no wandering of time."""
    step_g = _step_g(simulator, values)
    return force_g if step_g is None else quantised_mean(force_g, step_g, np.array(simulator.rig.noise_g))


def simulate_noisy_sample(simulator: Simulator, values: Array, force_g: Array) -> Array:
    """With noise, and in steps where they are coarse: they leave more noise where a reading stands between two."""
    noisy_g = force_g + np.array(simulator.rig.noise_g) * np.random.default_rng(0).normal(size=force_g.shape)
    step_g = _step_g(simulator, values)
    return noisy_g if step_g is None else step_g * np.round(noisy_g / step_g)


def _step_g(simulator: Simulator, values: Array) -> float | None:
    steps = simulator.effects(values).get(Quantization.name)
    return None if steps is None else float(np.asarray(steps["lsb_g"]))


def step_variance(fraction: float, dt: float) -> float:
    """Variance of true time's step from knot to knot where this part of the samples is lost, s^2."""
    return max(fraction, 1e-3) * KNOT_SPACING_SAMPLES * dt**2


def _apply_step(simulator: Simulator, values: Array, free: Sequence[int], step: Array) -> Array:
    """The free values after a step, inside their bounds."""
    lower, upper = (np.array([getattr(simulator.parameters[i], side) for i in free]) for side in ("lower", "upper"))
    lags = np.isin(free, _cutoff_indices(simulator))
    now = values[list(free)]
    moved = now + step
    moved[lags] = 1 / np.clip(1 / now[lags] + step[lags], 1 / upper[lags], 1 / lower[lags])
    found: Array = np.clip(moved, lower, upper)
    return found


def _cutoff_indices(simulator: Simulator) -> list[int]:
    return [i for i, slot in enumerate(simulator.parameters) if slot.is_cutoff]


def lowpass(residual: Array, dt: float) -> Array:
    """What is below `SLOW_HZ`, shape (n, 3)."""
    transform = np.fft.rfft(residual, axis=0)
    transform[np.fft.rfftfreq(len(residual), dt) > SWING_LOWPASS_HZ] = 0
    return np.fft.irfft(transform, len(residual), axis=0)


def _force_increasing(true_s: Array, dt: float) -> Array:
    """Times at least a tenth of a sample apart."""
    steps = np.maximum(np.diff(true_s), 0.1 * dt)
    return np.concatenate([true_s[:1], true_s[0] + np.cumsum(steps)])


def viterbi_loss_count(simulator: Simulator, walk: TimeWarp, observations: Observations) -> TimeWarp:
    """The walk in whole samples: which were lost, by the most likely path (Viterbi 1967), with a machine's line if there is one.

    The line's phase tells a lost sample where the swing alone cannot.
    """
    o = observations
    dt = float(np.median(np.diff(o.time_s)))
    rows = np.arange(len(o.time_s))
    lost = np.maximum.accumulate(np.round(walk.true_s / dt - rows)).astype(np.int64)
    values, fraction, line = walk.values.copy(), walk.fraction, None
    for turn in range(LOSS_COUNT_ITERATIONS):
        true_s = np.asarray(walk.true_s if turn == 0 else (rows + lost) * dt, dtype=np.float64)
        lin = simulator.linearise(values, true_s, o.temperature_c)
        if turn:
            by_start = (lin.jacobian[:, :, :HEADING] * (o.used[:, None] / o.noise_g)[:, :, None]).reshape(-1, HEADING)
            residual = o.residual_sigma(lin.force_g + _machine_line_signal(line, true_s)).ravel()
            values[:HEADING] += np.linalg.lstsq(by_start, residual, rcond=None)[0]
        line = find_machine_line(true_s, o.force_g - simulator.predict(values, true_s, o.temperature_c), o.noise_g)
        grid_s = np.arange(lost[-1] + len(rows) + VITERBI_REACH_SAMPLES + 1) * dt
        force_g = simulator.predict(values, grid_s) + _machine_line_signal(line, grid_s)
        lost = _most_likely_path(o, force_g, lost, max(fraction, 1e-3))
        fraction = float(lost[-1] / (lost[-1] + len(rows)))
    true_s = np.asarray((rows + lost) * dt, dtype=np.float64)
    force_g = simulator.predict(values, true_s, o.temperature_c) + _machine_line_signal(line, true_s)
    reduced = float((o.residual_sigma(force_g) ** 2).sum() / o.n_values)
    return replace(walk, true_s=true_s, fraction=fraction, reduced=reduced, values=values)


def _most_likely_path(o: Observations, force_g: Array, near: NDArray[np.int64], fraction: float) -> NDArray[np.int64]:
    """How many samples were lost before each, within `REACH` of an estimate; force_g on the even grid of all samples."""
    offsets = np.arange(-VITERBI_REACH_SAMPLES, VITERBI_REACH_SAMPLES + 1)
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


def _machine_line_signal(line: MachineLine | None, true_s: Array) -> Array:
    if line is None:
        return np.zeros((len(true_s), 3))
    shaking: Array = (line.phasors_g * np.exp(2j * np.pi * line.frequency_hz * true_s)[:, None]).real
    return shaking
