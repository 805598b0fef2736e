"""The time warp of a recording with lost samples: true time as a function of recorded time.

Samples that were lost without a gap in the time stamps make recorded time fall behind by whole samples, at random times. True
time is then a linear function of recorded time plus a random walk. The walk is estimated by least squares from the derivatives
of the simulation by time, with its variance as prior.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.sensor_output import Quantization
from gateway.twin.reconcile.data.artefact_detectors import quantised_mean, quantised_variance
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.levenberg_marquardt import SCREENING_ITERATIONS
from gateway.twin.reconcile.fit.reparameterisation import ReparameterisedSimulator, reparameterise
from gateway.twin.reconcile.timing.time_warp_smoother import (
    KNOT_SPACING_SAMPLES,
    effective_degrees_of_freedom,
    make_knots,
    marginalise_time_warp,
)
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
INITIAL_STATES = tuple(range(HEADING))
"""Positions of the initial states that are fitted: tilts and rates."""
MIN_LOST_FRACTION = 0.002
"""Smallest fraction of lost samples that is looked for: two in a minute at 20 Hz."""
MAX_SWING_HZ = 5.0
"""Frequency up to which the residual determines the time warp: swings are slower, machine vibration is faster."""
MIN_INTERVAL_SAMPLES = 0.1
"""Smallest interval between true times, in sampling intervals."""


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
        step, _ = smoother.solve(positions)
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
    return force_g if step_g is None else quantised_mean(force_g, step_g, np.array(simulator.rig.noise_g))


def noise_chi2_below_swing_frequencies(
    simulator: Simulator, values: Array, force_g: Array, observations: Observations
) -> float:
    """Return the mean chi-square that noise and quantisation leave in the band of `lowpass`.

    Quantisation adds more to a reading that is halfway between two steps.
    """
    noise_g, step_g = np.array(simulator.rig.noise_g), _step_g(simulator, values)
    variance = np.full(force_g.shape, noise_g**2) if step_g is None else quantised_variance(force_g, step_g, noise_g)
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
