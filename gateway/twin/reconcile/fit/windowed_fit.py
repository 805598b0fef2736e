"""Fit of a large swing in windows that share the effects and have an initial state each (variable projection).

A model without the right losses cannot follow a swing that decays, and a fit that begins with continuity constraints diverges.
Without them, the initial state of each window is eliminated, and the change of the samples within the windows determines the
effects (Golub and Pereyra 1973).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.data_checks import MIN_PERIODS
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.levenberg_marquardt import FIT_ITERATIONS
from gateway.twin.reconcile.fit.prior import NormalPrior, no_prior
from gateway.twin.simulator.compiled_model import IntegrationError
from gateway.twin.simulator.simulator import SegmentBatch, Simulator
from gateway.twin.simulator.state import HEADING, ROPE_RATES, ROPE_TILTS

Array = NDArray[np.float64]
LOWEST_POINT_SEARCH_PERIODS = 0.55
"""Length of the interval, in periods, in which a lowest point is searched: there are two in each period."""
RATE_INTERVAL_PERIODS = 0.02
"""Interval over which the difference of two tilts gives a rate, in periods."""
STEP_FRACTIONS = (1.0, 0.3, 0.1)
"""Fractions of a step that are tried in turn until chi-square falls."""
RANK_TOLERANCE = 1e-5
"""Singular value, relative to the largest, below which samples do not determine a combination of values, such as the azimuth of a
swing seen at the load."""
MIN_RELATIVE_GAIN = 1e-3
"""A windowed fit ends when a step lowers chi-square by less than this share; it only has to start the next fit."""


def window_bounds(rig: TwinRig, observations: Observations) -> list[int]:
    """Return the first samples of windows of about two periods.

    All but the first begin at a lowest point, where the samples determine the initial state well.
    """
    period_s = swing_period_s(rig, observations)
    count = max(1, round(observations.duration_s / (MIN_PERIODS * period_s)))
    first_samples = {0}
    for nominal_s in observations.duration_s * np.arange(1, count) / count:
        distance_s = np.abs(observations.time_s - nominal_s)
        near = np.flatnonzero(distance_s < LOWEST_POINT_SEARCH_PERIODS / 2 * period_s)
        first_samples.add(int(near[np.argmax(observations.force_g[near, 2])]))
    return sorted(first_samples)


def swing_period_s(rig: TwinRig, observations: Observations) -> float:
    """Return the nominal period at the recording's amplitude."""
    return rig.small_swing_period_s * period_ratio(observations.amplitude_rad)


def initial_state_from_samples(
    rig: TwinRig, observations: Observations, first_samples: Sequence[int], n_states: int
) -> Array:
    """Return the tilts and rates that the lateral readings show at the first samples of windows, shape (windows, states).

    The lateral reading of a free swing is (1 - p/L) sin(tilt) in g, which is too small near the load. Where the stated length is
    wrong, that of a large swing may seem to exceed the amplitude, which the axial reading gives.
    """
    initial_states = np.zeros((len(first_samples), n_states))
    gain = 1 - rig.position_m / rig.length_m
    interval_s = RATE_INTERVAL_PERIODS * swing_period_s(rig, observations)
    ahead = max(1, int(np.searchsorted(observations.time_s, interval_s)))
    at = np.minimum(np.array(first_samples), len(observations.time_s) - 1 - ahead)
    largest = np.sin(min(observations.amplitude_rad, np.pi / 2)) if observations.has_large_amplitude else 1.0
    horizontal = observations.force_g[:, :2] / gain
    horizontal *= np.minimum(1.0, largest / np.maximum(np.hypot(*horizontal.T), 1e-12))[:, None]
    tilt, tilt_ahead = np.arcsin(horizontal[at]), np.arcsin(horizontal[at + ahead])
    initial_states[:, ROPE_TILTS] = tilt
    elapsed_s = observations.time_s[at + ahead] - observations.time_s[at]
    initial_states[:, ROPE_RATES] = (tilt_ahead - tilt) / elapsed_s[:, None]
    return initial_states


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
    weight = (observations.used[:, None] / observations.noise_g)[..., None]
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
def fit_windows(
    simulator: Simulator,
    observations: Observations,
    initial_states: Array,
    effect_values: Array,
    free: NDArray[np.bool_],
    first_samples: Sequence[int],
    tick: Callable[[], None] = lambda: None,
    prior: NormalPrior | None = None,
) -> tuple[Array, Array, SegmentBatch]:
    """Return the fitted initial states (windows, states) and effect values (k,), and the linearisation there.

    Of the effect values those in `free` (k,) are fitted, inside their bounds, by Gauss-Newton with the initial states eliminated.
    Raises `LinAlgError` as the solver does, and `IntegrationError` where the windows diverge.
    """
    time_s, temperature_c = observations.time_s, observations.temperature_c
    batch = simulator.linearise_segments(initial_states, effect_values, time_s, first_samples, temperature_c)
    if not batch.is_finite:
        raise IntegrationError("the trajectories of the windows diverge from these values")
    known = (no_prior(simulator) if prior is None else prior).of_effects(simulator.n_initial_states)
    chi2 = observations.chi2(batch.force_g) + known.chi2(effect_values)
    for _ in range(FIT_ITERATIONS):
        windows = split_windows(batch, observations, first_samples)
        effect_step = _effect_step(simulator, windows, effect_values, free, known)
        state_steps = np.array([window.state_step(effect_step) for window in windows])
        gain = 0.0
        for fraction in STEP_FRACTIONS:
            tick()
            states_after, effects_after = (
                initial_states + fraction * state_steps,
                effect_values + fraction * effect_step,
            )
            after = simulator.linearise_segments(states_after, effects_after, time_s, first_samples, temperature_c)
            left = observations.chi2(after.force_g) + known.chi2(effects_after)
            gain = chi2 - left if after.is_finite else 0.0
            if gain > 0:
                initial_states, effect_values, batch, chi2 = states_after, effects_after, after, chi2 - gain
                break
        if not gain > MIN_RELATIVE_GAIN * chi2:
            break
    return initial_states, effect_values, batch


def project_out_initial_states(
    batch: SegmentBatch, observations: Observations, first_samples: Sequence[int]
) -> tuple[Array, Array]:
    """Return the effects' columns (3 n, k) and the residual (3 n,) in sigma, without what the initial states explain."""
    return _stack_projected(split_windows(batch, observations, first_samples))


def _stack_projected(windows: Sequence[FitWindow]) -> tuple[Array, Array]:
    projected = map(FitWindow.project_out_initial_state, windows)
    by_effects, residual = (np.concatenate(each) for each in zip(*projected, strict=True))
    return by_effects, residual


def _effect_step(
    simulator: Simulator,
    windows: Sequence[FitWindow],
    effect_values: Array,
    free: NDArray[np.bool_],
    prior: NormalPrior,
) -> Array:
    """Return the Gauss-Newton step of the free effect values, cut at their bounds, shape (k,)."""
    step = np.zeros(len(effect_values))
    if not free.any():
        return step
    by_effects, residual = _stack_projected(windows)
    weight = np.sqrt(prior.precision)
    by_effects = np.concatenate([by_effects, np.diag(weight)])
    residual = np.concatenate([residual, weight * (prior.centre - effect_values)])
    step[free] = np.linalg.lstsq(by_effects[:, free], residual, rcond=RANK_TOLERANCE)[0]
    lower = np.array([parameter.lower for parameter in simulator.effect_parameters])
    upper = np.array([parameter.upper for parameter in simulator.effect_parameters])
    inside: Array = np.clip(effect_values + step, lower, upper) - effect_values
    return inside
