"""Least squares by multiple shooting: each segment has a start of its own, continuity closes the gaps as the fit converges.

The step is condensed (Bock 1981, Albersmeyer and Diehl 2010, "lifted Newton"): the starts of later segments follow from the
first start and the effects' values by the linearised continuity, so the normal equations are as small as in single shooting.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.simulator.compiled_model import IntegrationError
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
SEGMENT_S = 30.0
CONTINUITY_TOLERANCE = 1e-3
"""Gaps between segments, rad and rad/s, below which one segment goes on alone: it is as linear, and quicker."""
MIN_RELATIVE_DECREASE = 1e-5
"""Stop when a step lowers chi-square by less than this part, or by less than `SMALLEST_DROP`."""
MIN_DECREASE = 0.05
JOIN_RELATIVE_DECREASE = 0.3
INITIAL_DAMPING_LEVEL, UNDAMPED_LEVEL = 1, 1
"""Levels; a damped step that gains little says nothing of how near the end is."""
GIVE_UP_AFTER = 2
DAMPING_FACTORS = (1e-8, 3e-7, 1e-5, 3e-4, 1e-2, 0.3, 10.0)
"""Levenberg-Marquardt factors on the scaled diagonal, tried in turn until chi-square falls."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to observations."""

    names: tuple[str, ...]
    values: Array
    """Start and effects' values in the simulator's order."""
    free: NDArray[np.bool_]
    force_g: Array
    """Simulated, shape (n, 3)."""
    chi2: float
    """Sum over the samples that count."""
    normal: Array
    """J^T J of the free values."""
    jacobian: Array
    """In sigma, by all values, shape (n, 3, values); from the last linearisation."""

    def covariance(self) -> Array:
        """Of the free values, white noise; pseudo-inverse where something is not determined."""
        diagonal = np.diag(self.normal)
        scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        found: Array = np.linalg.pinv(self.normal / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
        return found


FROZEN_ITERATIONS = 2
"""Rounds in which times stand still: where nothing acts yet they have no sensitivity."""


def uniform_segments(observations: Observations, segment_s: float = SEGMENT_S) -> list[int]:
    """First samples of segments of about this length."""
    count = max(1, round(observations.duration_s / segment_s))
    edges_s = np.linspace(0, observations.duration_s, count + 1)[:-1]
    return [int(i) for i in np.searchsorted(observations.time_s, edges_s)]


@dataclass(frozen=True, slots=True)
class _CondensedProblem:
    residual: Array
    """Sigma, with the gaps closed to first order, shape (n, 3)."""
    jacobian: Array
    """Sigma, by first start and effects, shape (n, 3, values)."""
    close: Array
    """By how much each start moves to close the gaps, shape (segments, starts)."""
    follow: Array
    """Each start by first start and effects, shape (segments, starts, values)."""
    gap: float


def fit_model(
    simulator: Simulator,
    observations: Observations,
    starts: Array,
    effects: Array,
    free: NDArray[np.bool_],
    firsts: Sequence[int],
    iterations: int = 8,
    tick: Callable[[], None] = lambda: None,
    beyond: float = np.inf,
) -> Fit:
    """Fit the free values from starts (segments, n starts) and the effects' values; bounds are the simulator's.

    A value that is not free stays as it is; of the first start only the free coordinates move. A fit that at its pace would not
    come below the chi-square `beyond` is given up.
    """
    lower = np.array([slot.lower for slot in simulator.parameters])
    upper = np.array([slot.upper for slot in simulator.parameters])
    reach = np.array([slot.step_limit for slot in simulator.parameters])
    timed = np.array([slot.is_event_time for slot in simulator.parameters])
    lags = np.array([slot.is_cutoff for slot in simulator.parameters])
    now = _condense(simulator, observations, starts, effects, firsts)
    chi2, damping = float((now.residual**2).sum()), INITIAL_DAMPING_LEVEL
    settling = FROZEN_ITERATIONS if (timed & free).any() else 0
    for turn in range(iterations + settling):
        values = np.concatenate([starts[0], effects])
        at, to, by = (
            _invert_cutoffs(values, lags),
            _invert_cutoffs(np.stack([lower, upper]), lags),
            np.ones(len(values)),
        )
        by[lags] = -(values[lags] ** 2)
        near, far = np.maximum(to.min(axis=0), at - reach), np.minimum(to.max(axis=0), at + reach)
        moving = free & ~timed if turn < settling else free
        accepted = False
        for level in range(damping, len(DAMPING_FACTORS)):
            tick()
            step = _step(now.residual, now.jacobian * by, at, moving, near, far, DAMPING_FACTORS[level])
            step = _invert_cutoffs(at + step, lags) - values
            moved = starts + now.close + now.follow @ step
            changed = effects + step[simulator.n_initial_states :]
            found = _evaluate_step(simulator, observations, moved, changed, firsts, chi2)
            if found is None:
                continue
            tried, tried_chi2 = found, float((found.residual**2).sum())
            if tried_chi2 < chi2 or (now.gap > CONTINUITY_TOLERANCE and tried.gap < now.gap / 2):
                accepted, damping = True, level
                break
        if not accepted and turn >= settling:
            break
        if not accepted:
            damping = INITIAL_DAMPING_LEVEL
            continue
        gain, closed = chi2 - tried_chi2, now.gap < CONTINUITY_TOLERANCE
        starts, effects, now, chi2 = moved, changed, tried, tried_chi2
        damping = max(0, damping - 1)
        pace = max(gain, 0.0) * (iterations + settling - turn)
        if turn >= settling + GIVE_UP_AFTER and closed and chi2 - pace > beyond:
            break
        if (
            closed
            and turn >= settling
            and level <= UNDAMPED_LEVEL
            and gain < max(MIN_DECREASE, MIN_RELATIVE_DECREASE * chi2)
        ):
            break
        if len(starts) > 1 and now.gap < CONTINUITY_TOLERANCE and gain < JOIN_RELATIVE_DECREASE * chi2:
            starts, firsts = starts[:1], [0]
            now = _condense(simulator, observations, starts, effects, firsts)
            chi2 = float((now.residual**2).sum())
    return _make_fit(simulator, observations, np.concatenate([starts[0], effects]), free, now)


def _evaluate_step(
    simulator: Simulator, observations: Observations, starts: Array, effects: Array, firsts: Sequence[int], chi2: float
) -> _CondensedProblem | None:
    """Where a step leads; None where one motion leaves as much as before, or none can be followed."""
    try:
        if len(starts) == 1 and _single_shooting_chi2(simulator, observations, starts[0], effects) >= chi2:
            return None  # a prediction alone is several times quicker
        return _condense(simulator, observations, starts, effects, firsts)
    except IntegrationError:
        return None


def _single_shooting_chi2(simulator: Simulator, observations: Observations, start: Array, effects: Array) -> float:
    force_g = simulator.predict(np.concatenate([start, effects]), observations.time_s, observations.temperature_c)
    return float((observations.residual_sigma(force_g) ** 2).sum())


def _make_fit(
    simulator: Simulator, observations: Observations, values: Array, free: NDArray[np.bool_], now: _CondensedProblem
) -> Fit:
    force_g = simulator.predict(values, observations.time_s, observations.temperature_c)
    chi2 = float((observations.residual_sigma(force_g) ** 2).sum())
    flat = now.jacobian[..., free].reshape(-1, int(free.sum()))
    return Fit(simulator.effect_names, values, free, force_g, chi2, flat.T @ flat, now.jacobian)


def _condense(
    simulator: Simulator, observations: Observations, starts: Array, effects: Array, firsts: Sequence[int]
) -> _CondensedProblem:
    found = simulator.linearise_segments(starts, effects, observations.time_s, firsts, observations.temperature_c)
    n, count = simulator.n_initial_states, simulator.n_initial_states + len(effects)
    close, follow = np.zeros_like(starts), np.zeros((len(starts), n, count))
    follow[0, :, :n] = np.eye(n)
    gaps = found.ends[:-1] - starts[1:]
    gaps[:, HEADING] = (gaps[:, HEADING] + np.pi) % (2 * np.pi) - np.pi
    for i, gap in enumerate(gaps):
        close[i + 1] = found.ends_by_start[i] @ close[i] + gap
        follow[i + 1] = found.ends_by_start[i] @ follow[i]
        follow[i + 1, :, n:] += found.ends_by_effects[i]
    weight = observations.used[:, None] / observations.noise_g
    residual = observations.residual_sigma(found.force_g)
    jacobian = np.empty((len(residual), 3, count))
    for i, (first, last) in enumerate(zip(firsts, [*firsts[1:], len(residual)], strict=True)):
        by_start = found.force_by_start[first:last].reshape(-1, n)  # one product of matrices, not one for each sample
        jacobian[first:last] = (by_start @ follow[i]).reshape(-1, 3, count)
        residual[first:last] -= (by_start @ close[i]).reshape(-1, 3) * weight[first:last]
    jacobian[..., n:] += found.force_by_effects
    jacobian *= weight[..., None]
    return _CondensedProblem(residual, jacobian, close, follow, float(np.abs(gaps).max(initial=0.0)))


def _invert_cutoffs(values: Array, lags: NDArray[np.bool_]) -> Array:
    """Cutoffs as their inverse and back: a lag is a shift of time, which the initial motion makes up for in proportion."""
    found = values.copy()
    found[..., lags] = 1 / values[..., lags]
    return found


def _step(
    residual: Array,
    jacobian: Array,
    values: Array,
    free: NDArray[np.bool_],
    lower: Array,
    upper: Array,
    damping: float,
) -> Array:
    """A damped Gauss-Newton step inside the bounds: what would leave them is set on them and the rest solved again."""
    step = np.zeros(len(values))
    held = ~free
    flat = jacobian.reshape(-1, len(values))
    normal, gradient = flat.T @ flat, flat.T @ residual.ravel()
    for _ in range(len(values)):
        moving = np.flatnonzero(~held)
        if not len(moving):
            break
        matrix = normal[np.ix_(moving, moving)]
        scale = np.sqrt(np.diag(matrix)) + 1e-12
        right = (gradient[moving] - normal[np.ix_(moving, np.flatnonzero(held))] @ step[held]) / scale
        scaled = matrix / np.outer(scale, scale) + damping * np.eye(len(moving))
        step[moving] = np.linalg.solve(scaled, right) / scale
        outside = (values[moving] + step[moving] < lower[moving]) | (values[moving] + step[moving] > upper[moving])
        if not outside.any():
            break
        for place in moving[outside]:
            bound = lower[place] if values[place] + step[place] < lower[place] else upper[place]
            step[place] = bound - values[place]
            held[place] = True
    return step
