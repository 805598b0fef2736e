"""Wide swings: pieces of two swings, each with a start of its own, and effects in common, before they are joined to one motion.

A model without the right losses cannot join pieces of a swing that dies away, and a fit that begins by closing the gaps runs
off. Without continuity each piece's start is eliminated, and the effects follow from how the readings change within the pieces.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.data_checks import MIN_PERIODS
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.multiple_shooting import fit_model
from gateway.twin.simulator.simulator import SegmentBatch, Simulator
from gateway.twin.simulator.state import HEADING, ROPE_RATES, ROPE_TILTS

Array = NDArray[np.float64]
LOWEST_POINT_SEARCH_PERIODS = 0.55
"""Part of a period within which there is a passage through the lowest point."""
RATE_INTERVAL_PERIODS = 0.02
"""Part of a period over which a rate is read off."""
MIN_DISTANCE_TO_LOAD_SHARE = 0.1
"""1 - position/length, below which the readings across the rope say too little of a tilt."""
WINDOWED_ITERATIONS = 8
STEP_FRACTIONS = (1.0, 0.3, 0.1)
"""Parts of a step that are tried in turn until chi-square falls."""
MIN_RELATIVE_GAIN = 1e-3
"""Part of chi-square below which a step gains too little to go on."""
LARGE_AMPLITUDE_ITERATIONS = 30
"""Of a fit of one motion: the period tells on every parameter, and gaps close slowly."""
SINGLE_TRAJECTORY_ITERATIONS = 8
"""Of a fit that only shows how far a model is from the data."""
START_SCALES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)


def window_bounds(rig: TwinRig, observations: Observations) -> list[int]:
    """First samples of pieces of about two swings; all but the first begin at the lowest point, where a start is regular."""
    period_s = swing_period_s(rig, observations)
    count = max(1, round(observations.duration_s / (MIN_PERIODS * period_s)))
    found = {0}
    for wanted_s in observations.duration_s * np.arange(1, count) / count:
        near = np.flatnonzero(np.abs(observations.time_s - wanted_s) < LOWEST_POINT_SEARCH_PERIODS / 2 * period_s)
        found.add(int(near[np.argmax(observations.force_g[near, 2])]))
    return sorted(found)


def swing_period_s(rig: TwinRig, observations: Observations) -> float:
    """Period at the recording's amplitude."""
    return rig.small_swing_period_s * period_ratio(observations.amplitude_rad)


def initial_state_from_samples(rig: TwinRig, observations: Observations, firsts: Sequence[int], size: int) -> Array:
    """Tilts and rates that the readings across the rope show at the pieces' first samples, shape (pieces, size).

    A free swing's reading across the rope is (1 - p/L) sin(tilt) in g.
    """
    starts = np.zeros((len(firsts), size))
    share = 1 - rig.position_m / rig.length_m
    if share < MIN_DISTANCE_TO_LOAD_SHARE:
        return starts
    ahead = max(1, int(np.searchsorted(observations.time_s, RATE_INTERVAL_PERIODS * swing_period_s(rig, observations))))
    at = np.minimum(np.array(firsts), len(observations.time_s) - 1 - ahead)
    now, later = (np.arcsin(np.clip(observations.force_g[i, :2] / share, -1.0, 1.0)) for i in (at, at + ahead))
    starts[:, ROPE_TILTS] = now
    starts[:, ROPE_RATES] = (later - now) / (observations.time_s[at + ahead] - observations.time_s[at])[:, None]
    return starts


def fit_trajectory(
    simulator: Simulator,
    observations: Observations,
    starts: Array,
    effects: Array,
    free: NDArray[np.bool_],
    firsts: Sequence[int],
    rounds: int,
    tick: Callable[[], None] = lambda: None,
    beyond: float = np.inf,
) -> Fit:
    """`fit_model`; of a wide swing in pieces first.

    Where the pieces of a wide swing cannot be joined, the motion goes on from the first of them as far as it is true.
    """
    if not observations.has_large_amplitude:
        return fit_model(simulator, observations, starts, effects, free, firsts, rounds, tick, beyond)
    with np.errstate(over="ignore", invalid="ignore"):  # a motion that runs away is no fit, and is not kept
        starts, effects, _ = fit_windows(
            simulator, observations, starts, effects, free[simulator.n_initial_states :], firsts, tick
        )
        rounds = max(rounds, LARGE_AMPLITUDE_ITERATIONS)
        try:
            fit = fit_model(simulator, observations, starts, effects, free, firsts, rounds, tick, beyond)
            if np.isfinite(fit.chi2):
                return fit
        except np.linalg.LinAlgError:
            pass
        alone = _best_scaled_start(simulator, observations, starts[0], effects)
        return fit_model(simulator, observations, alone, effects, free, [0], SINGLE_TRAJECTORY_ITERATIONS, tick)


def _best_scaled_start(simulator: Simulator, observations: Observations, start: Array, effects: Array) -> Array:
    """Of this start and weaker ones the one from which a single motion comes nearest to all readings, shape (1, starts)."""
    tried = []
    for part in START_SCALES:
        weaker = np.where(np.arange(len(start)) == HEADING, start, part * start)
        force_g = simulator.predict(np.concatenate([weaker, effects]), observations.time_s, observations.temperature_c)
        chi2 = float((observations.residual_sigma(force_g) ** 2).sum())
        tried.append((chi2 if np.isfinite(chi2) else np.inf, weaker))
    return min(tried, key=lambda each: each[0])[1][None]


@dataclass(frozen=True, slots=True)
class FitWindow:
    """Of a linearisation, in sigma; rows are numbers that were read."""

    by_start: Array
    """Without the heading, shape (rows, starts - 1)."""
    by_effects: Array
    """Shape (rows, effect values)."""
    residual: Array
    """Shape (rows,)."""

    def project_out_initial_state(self) -> tuple[Array, Array]:
        """The part of the effects' columns and of the residual that no start makes."""
        basis = np.linalg.qr(self.by_start)[0]
        rows = self.by_effects - basis @ (basis.T @ self.by_effects)
        right = self.residual - basis @ (basis.T @ self.residual)
        return np.asarray(rows, dtype=np.float64), np.asarray(right, dtype=np.float64)

    def start_step(self, step: Array) -> Array:
        """How the start moves when the effects take a step."""
        found = np.linalg.lstsq(self.by_start, self.residual - self.by_effects @ step, rcond=None)[0]
        return np.asarray(found, dtype=np.float64)


def split_windows(found: SegmentBatch, observations: Observations, firsts: Sequence[int]) -> list[FitWindow]:
    """The pieces of a linearisation."""
    weight = (observations.used[:, None] / observations.noise_g)[..., None]
    by_start = np.delete(found.force_by_start, HEADING, axis=2) * weight
    by_effects, residual = found.force_by_effects * weight, observations.residual_sigma(found.force_g)
    return [
        FitWindow(
            by_start[first:last].reshape(3 * (last - first), -1),
            by_effects[first:last].reshape(3 * (last - first), -1),
            residual[first:last].ravel(),
        )
        for first, last in itertools.pairwise([*firsts, len(residual)])
    ]


def fit_windows(
    simulator: Simulator,
    observations: Observations,
    starts: Array,
    effects: Array,
    free: NDArray[np.bool_],
    firsts: Sequence[int],
    tick: Callable[[], None] = lambda: None,
) -> tuple[Array, Array, SegmentBatch]:
    """Starts (pieces, starts) and effects' values, of which those in `free` (effect values) move inside their bounds.

    Gauss-Newton with the starts eliminated. Also returns the linearisation there. Raises `LinAlgError` and `ValueError` as
    the simulator and the solver do.
    """
    now = simulator.linearise_segments(starts, effects, observations.time_s, firsts, observations.temperature_c)
    chi2 = _chi2(observations, now)
    for _ in range(WINDOWED_ITERATIONS):
        pieces = split_windows(now, observations, firsts)
        step = _step(simulator, pieces, effects, free)
        gain = 0.0
        for part in STEP_FRACTIONS:
            tick()
            moves = np.array([np.insert(piece.start_step(step), HEADING, 0.0) for piece in pieces])
            moved, changed = starts + part * moves, effects + part * step
            tried = simulator.linearise_segments(
                moved, changed, observations.time_s, firsts, observations.temperature_c
            )
            gain = chi2 - _chi2(observations, tried)
            if gain > 0:
                starts, effects, now, chi2 = moved, changed, tried, chi2 - gain
                break
        if not gain > MIN_RELATIVE_GAIN * chi2:
            break
    return starts, effects, now


def project_out_initial_states(
    found: SegmentBatch, observations: Observations, firsts: Sequence[int]
) -> tuple[Array, Array]:
    """Effects' columns (3 n, effect values) and residual (3 n,) in sigma, of both what no start of a piece makes."""
    return _stack_projected(split_windows(found, observations, firsts))


def _stack_projected(pieces: Sequence[FitWindow]) -> tuple[Array, Array]:
    rows, right = (np.concatenate(each) for each in zip(*map(FitWindow.project_out_initial_state, pieces), strict=True))
    return rows, right


def _chi2(observations: Observations, found: SegmentBatch) -> float:
    return float((observations.residual_sigma(found.force_g) ** 2).sum())


def _step(simulator: Simulator, pieces: Sequence[FitWindow], effects: Array, free: NDArray[np.bool_]) -> Array:
    step = np.zeros(len(effects))
    if not free.any():
        return step
    rows, right = _stack_projected(pieces)
    lower = np.array([slot.lower for slot in simulator.effect_parameters])
    upper = np.array([slot.upper for slot in simulator.effect_parameters])
    step[free] = np.linalg.lstsq(rows[:, free], right, rcond=None)[0]
    found: Array = np.clip(effects + step, lower, upper) - effects
    return found
