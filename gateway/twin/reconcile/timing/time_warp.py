"""The time warp of a recording with lost samples: true time as a function of recorded time.

Samples that were lost without a gap in the time stamps make recorded time fall behind by whole samples, at random times. True
time is then a linear function of recorded time plus a random walk with independent steps between knots. The walk is estimated by
least squares from the derivatives of the simulation by time, with the variance of its steps as prior. Its normal matrix is
tridiagonal, so that it is eliminated at little cost and recovered afterwards: a Kalman smoother as one linear system.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from gateway.twin.effects.sensor_output import Quantization
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.sensor import quantised_moments
from gateway.twin.reconcile.fit.least_squares import MIN_SCALE, SCREENING_ITERATIONS
from gateway.twin.reconcile.fit.reparameterisation import ReparameterisedSimulator, reparameterise
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
KNOT_SPACING_SAMPLES = 5
"""Samples between knots: a quarter of a second at 20 Hz, in which a swing hardly moves."""
RANK_TOLERANCE = 1e-10
"""Singular value of the scaled normal matrix, relative to the largest, below which values are linearly dependent."""
INITIAL_STATES = tuple(range(HEADING))
"""Positions of the initial states that are fitted: tilts and rates."""
MIN_LOST_FRACTION = 0.002
"""Smallest fraction of lost samples that is looked for: two in a minute at 20 Hz."""
MAX_SWING_HZ = 5.0
"""Frequency up to which the residual determines the time warp: swings are slower, machine vibration is faster."""
MIN_INTERVAL_SAMPLES = 0.1
"""Smallest interval between true times, in sampling intervals."""


@dataclass(frozen=True, slots=True)
class Knots:
    """The samples at which the warp is known; between them it is interpolated linearly."""

    before: NDArray[np.int64]
    """Knot at or before each sample, shape (n,)."""
    share: Array
    """Share of the way from that knot to the next, shape (n,)."""
    count: int

    def at_samples(self, warp: Array) -> Array:
        """Return a warp (count,) at the samples, shape (n,)."""
        interpolated: Array = warp[self.before] * (1 - self.share) + warp[self.before + 1] * self.share
        return interpolated

    def gathered(self, values: Array) -> Array:
        """Return the sums at the knots of values (n, k) at samples, each shared by two knots, shape (count, k)."""
        sums = np.zeros((self.count, values.shape[1]))
        np.add.at(sums, self.before, (1 - self.share)[:, None] * values)
        np.add.at(sums, self.before + 1, self.share[:, None] * values)
        return sums


def make_knots(samples: int) -> Knots:
    """Return knots for so many samples, the first at the first of them, the last at the last or beyond."""
    rows = np.arange(samples)
    return Knots(
        rows // KNOT_SPACING_SAMPLES,
        (rows % KNOT_SPACING_SAMPLES) / KNOT_SPACING_SAMPLES,
        len(range(0, samples + KNOT_SPACING_SAMPLES, KNOT_SPACING_SAMPLES)),
    )


@dataclass(frozen=True, slots=True)
class TimeWarpSmoother:
    """Normal equations of k values after the warp is eliminated."""

    normal: Array
    """Shape (k, k)."""
    gradient: Array
    """Shape (k,)."""
    warp_by_values: Array
    """Change of the warp per step of -1 in each value; last the warp where no value moves, shape (count, k + 1)."""

    def solve(self, chosen: Sequence[int]) -> Array:
        """Return the step of the chosen values, the others held."""
        normal, gradient = self.normal[np.ix_(chosen, chosen)], self.gradient[list(chosen)]
        scale = np.sqrt(np.maximum(np.diag(normal), 0.0)) + MIN_SCALE
        scaled = np.linalg.lstsq(normal / np.outer(scale, scale), gradient / scale, rcond=RANK_TOLERANCE)[0]
        step: Array = scaled / scale
        return step

    def warp(self, chosen: Sequence[int], step: Array) -> Array:
        """Return the warp that goes with a step of the chosen values, shape (count,)."""
        warp: Array = self.warp_by_values[:, -1] - self.warp_by_values[:, list(chosen)] @ step
        return warp


def marginalise_time_warp(
    residual: Array, by_time: Array, by_values: Array, warp: Array, knots: Knots, step_variance: float
) -> TimeWarpSmoother:
    """Return the normal equations for residuals (n, 3) in sigma that were computed with a warp (count,).

    `by_time` (n, 3) and `by_values` (n, 3, k) are the derivatives of the simulation; `step_variance` is that between knots.
    """
    without_warp = residual + by_time * knots.at_samples(warp)[:, None]
    columns = np.concatenate([by_values, without_warp[:, :, None]], axis=2)
    by_knots = knots.gathered(np.einsum("ni,nik->nk", by_time, columns))
    warp_by_values = _solve_warp(by_time, knots, step_variance, by_knots)
    flat = columns.reshape(-1, columns.shape[2])
    normal = flat.T @ flat - by_knots.T @ warp_by_values
    return TimeWarpSmoother(normal[:-1, :-1], normal[:-1, -1], warp_by_values)


def effective_degrees_of_freedom(by_time: Array, knots: Knots, step_variance: float) -> float:
    """Return the number of steps of the warp that the samples determine, and not the prior (MacKay 1992)."""
    steps = np.diff(np.eye(knots.count), axis=0)
    from_prior = _solve_warp(by_time, knots, step_variance, steps.T @ steps / step_variance)
    return knots.count - 1 - float(np.trace(from_prior[1:, 1:]))


def _solve_warp(by_time: Array, knots: Knots, step_variance: float, right: Array) -> Array:
    """Return the solution of the warp's normal equations, shape (count, k); the warp is zero at the first knot."""
    square = (by_time**2).sum(axis=1)
    diagonal = np.full(knots.count, 2 / step_variance)
    diagonal[-1] = 1 / step_variance
    np.add.at(diagonal, knots.before, square * (1 - knots.share) ** 2)
    np.add.at(diagonal, knots.before + 1, square * knots.share**2)
    above = np.full(knots.count, -1 / step_variance)
    np.add.at(above, knots.before + 1, square * knots.share * (1 - knots.share))
    solution = np.zeros_like(right)
    solution[1:] = solveh_banded(np.stack([above, diagonal])[:, 1:], right[1:])
    return solution


@dataclass(frozen=True, slots=True)
class TimeWarp:
    """True times, and the residual with them."""

    true_s: Array
    """True time of each sample, increasing from 0, shape (n,)."""
    fraction: float
    """Fraction of the samples that are lost."""
    reduced: float
    """Reduced chi-square."""
    normalised_cost: float
    """Chi-square of the walk's steps over their effective number; about 1 for lost samples."""
    cost: float
    """Chi-square of the walk's steps under their prior."""
    values: Array
    """Initial state and effect values."""

    def retimed(self, observations: Observations) -> Observations:
        """Return the recording at its true times."""
        return replace(observations, time_s=self.true_s)


@dataclass(frozen=True, slots=True)
class TimeLinearisation:
    """A simulation at true times and its derivatives, in the coordinates of a fit."""

    force_g: Array
    """As the sensor quantises it, on average, shape (n, 3)."""
    by_time: Array
    """In sigma per second, shape (n, 3)."""
    by_values: Array
    """In sigma, shape (n, 3, values)."""
    is_finite: bool
    """Whether neither diverges."""


def estimate_time_warp(
    simulator: Simulator,
    values: Array,
    observations: Observations,
    fraction: float,
    free: Sequence[int] = INITIAL_STATES,
) -> TimeWarp | None:
    """Fit the time warp and the free values, from a first estimate of the fraction of lost samples; None where it diverges.

    The simulator has no clock effect: the linear part of the warp takes its place.
    """
    interval_s, n_states = observations.interval_s, simulator.n_initial_states
    model = reparameterise(simulator, np.isin(np.arange(len(values)), free))
    fitted = np.concatenate([values[:n_states], model.to_fitted(values[n_states:])])
    knots, positions = make_knots(len(observations.time_s)), list(free)
    warp, at_knots = np.zeros(knots.count), np.arange(knots.count - 1) * KNOT_SPACING_SAMPLES
    for iteration in range(SCREENING_ITERATIONS):
        linear_s = observations.time_s / (1 - fraction)
        true_s = _increasing(linear_s + knots.at_samples(warp), MIN_INTERVAL_SAMPLES * interval_s)
        linear = linearise_in_time(model, fitted, observations, true_s)
        residual, variance = observations.residual_sigma(linear.force_g), step_variance(fraction, interval_s)
        if not linear.is_finite:
            return None  # the last step left the domain of the equations of motion
        if iteration == SCREENING_ITERATIONS - 1:
            break
        smoothed = lowpass(residual, interval_s)
        smoother = marginalise_time_warp(smoothed, linear.by_time, linear.by_values, warp, knots, variance)
        step = smoother.solve(positions)
        warp = smoother.warp(positions, step)
        if not (np.isfinite(warp).all() and np.isfinite(step).all()):
            return None
        fitted[positions] = np.clip(fitted[positions] + step, model.lower[positions], model.upper[positions])
        # The linear part takes the mean slope of the walk.
        slope = float(np.polyfit(linear_s[at_knots], warp[:-1], 1)[0])
        fraction = 1 - (1 - fraction) / (1 + slope)
        warp = warp - slope * np.append(linear_s[at_knots], linear_s[-1])
        warp -= warp[0]
    cost = float((np.diff(warp) ** 2).sum() / variance)
    determined = effective_degrees_of_freedom(linear.by_time, knots, variance)
    reduced = float((residual**2).sum() / observations.n_values)
    physical = np.concatenate([fitted[:n_states], model.to_physical(fitted[n_states:])])
    return TimeWarp(true_s - true_s[0], fraction, reduced, cost / max(determined, 1.0), cost, physical)


def linearise_in_time(
    model: ReparameterisedSimulator, fitted: Array, observations: Observations, true_s: Array
) -> TimeLinearisation:
    """Return the linearisation at true times (n,), for an initial state and coordinates of a fit (values,)."""
    n_states = model.simulator.n_initial_states
    state, effects = fitted[:n_states], fitted[n_states:]
    batch = model.linearise_segments(state[None], effects, true_s, [0], observations.temperature_c)
    weight = observations.per_sigma
    by_values = np.concatenate([batch.force_by_start, batch.force_by_effects], axis=2) * weight[:, :, None]
    by_time = np.gradient(batch.force_g, true_s, axis=0) * weight
    values = np.concatenate([state, model.to_physical(effects)])
    return TimeLinearisation(
        quantised_mean_of(model.simulator, values, batch.force_g), by_time, by_values, batch.is_finite
    )


def quantised_mean_of(simulator: Simulator, values: Array, force_g: Array) -> Array:
    """Return the mean reading for a simulated force (n, 3): quantised where the model has that effect."""
    step_g = _step_g(simulator, values)
    return force_g if step_g is None else quantised_moments(force_g, step_g, np.array(simulator.rig.noise_g))[0]


def noise_chi2_below_swing_frequencies(
    simulator: Simulator, values: Array, force_g: Array, observations: Observations
) -> float:
    """Return the mean chi-square that noise and quantisation leave in the band of `lowpass`.

    Quantisation adds more to a reading that is halfway between two steps.
    """
    noise_g, step_g = np.array(simulator.rig.noise_g), _step_g(simulator, values)
    variance = np.full(force_g.shape, noise_g**2) if step_g is None else quantised_moments(force_g, step_g, noise_g)[1]
    frequency_hz = np.fft.fftfreq(len(force_g), observations.interval_s)
    share = float(np.mean(np.abs(frequency_hz) <= MAX_SWING_HZ))
    return float((variance / observations.noise_g**2 * observations.used[:, None]).sum()) * share


def _step_g(simulator: Simulator, values: Array) -> float | None:
    quantisation = simulator.effects(values).get(Quantization.name)
    return None if quantisation is None else float(np.asarray(quantisation["lsb_g"]))


def step_variance(fraction: float, interval_s: float) -> float:
    """Return the variance of the step of true time between knots where this fraction of the samples is lost, s^2."""
    return max(fraction, MIN_LOST_FRACTION) * KNOT_SPACING_SAMPLES * interval_s**2


def lowpass(residual: Array, interval_s: float) -> Array:
    """Return the part of a residual (n, 3) below `MAX_SWING_HZ`."""
    transform = np.fft.rfft(residual, axis=0)
    transform[np.fft.rfftfreq(len(residual), interval_s) > MAX_SWING_HZ] = 0
    return np.fft.irfft(transform, len(residual), axis=0)


def _increasing(true_s: Array, min_interval_s: float) -> Array:
    """Return times that are at least `min_interval_s` apart."""
    intervals = np.maximum(np.diff(true_s), min_interval_s)
    return np.concatenate([true_s[:1], true_s[0] + np.cumsum(intervals)])
