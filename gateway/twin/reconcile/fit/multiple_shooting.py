"""Least squares by multiple shooting with condensing (Bock 1981; Albersmeyer and Diehl 2010).

Each segment of a recording has an initial state of its own, so that the simulation cannot leave the data far behind. Continuity
constraints join the segments as the fit converges; once they hold, one segment remains. By the linearised constraints, the
initial state of each segment follows from that of the first and from the effect values, so that the normal equations are as
small as in single shooting. Each step is a Levenberg-Marquardt step of this condensed problem, inside the parameters' bounds and
step limits.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.simulator.compiled_model import IntegrationError
from gateway.twin.simulator.simulator import SegmentBatch, Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
FIT_ITERATIONS = 8
"""Iterations of most fits; nearly all converge earlier."""
REFINEMENT_ITERATIONS = 3
"""Iterations of a fit that starts near its minimum, or in which the samples are nearly linear."""
REFINE_ITERATIONS = 20
"""Iterations of a fit that continues along a narrow valley of chi-square."""
SCREENING_ITERATIONS = 6
"""Iterations of a fit that decides only whether a model is consistent with the data, or which guess is the best."""
LARGE_SWING_ITERATIONS = 30
"""Iterations of a fit of a large swing, or of one seen along the rope: its period depends on every parameter, its readings are
not nearly linear in the initial state, and its segments join slowly."""
Limits = Mapping[str, tuple[float, float]]
"""Lower and upper bounds of effect values by label, where a recording sets narrower ones than the effect."""
NO_LIMITS: Limits = {}
MIN_SCALE = 1e-12
"""Added to the scale of each parameter, so that one without any sensitivity gives no division by zero."""


def solve_damped(normal: Array, gradient: Array, damping: float) -> Array:
    """Return the solution of normal equations (k, k) and (k,); `damping` is added to the diagonal after scaling it to 1."""
    scale = np.sqrt(np.diag(normal)) + MIN_SCALE
    matrix = normal / np.outer(scale, scale) + damping * np.eye(len(scale))
    return np.linalg.solve(matrix, gradient / scale) / scale


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """A linearised least-squares problem in k values."""

    normal: Array
    """J^T J, shape (k, k)."""
    gradient: Array
    """J^T r, shape (k,)."""

    @classmethod
    def from_jacobian(cls, jacobian: Array, residual: Array) -> "NormalEquations":
        """Return the equations of a Jacobian (..., k) and a residual (...)."""
        flat = jacobian.reshape(-1, jacobian.shape[-1])
        return cls(flat.T @ flat, flat.T @ residual.ravel())

    def step(self, free: NDArray[np.bool_], damping: float, held: Array | None = None) -> Array:
        """Return a damped step of the free values, shape (k,); the others take the step `held` (k,), zero by default."""
        step = np.zeros(len(free)) if held is None else held.copy()
        moving, fixed = np.flatnonzero(free), np.flatnonzero(~free)
        gradient = self.gradient[moving] - self.normal[np.ix_(moving, fixed)] @ step[fixed]
        step[moving] = solve_damped(self.normal[np.ix_(moving, moving)], gradient, damping)
        return step

    def bounded_step(self, free: NDArray[np.bool_], smallest_step: Array, largest_step: Array, damping: float) -> Array:
        """Return a damped step of the free values between two limits, shape (k,).

        A value that would exceed a limit is set to it, and the others are solved again (active set).
        """
        step, moving = np.zeros(len(free)), free.copy()
        while moving.any():
            step = self.step(moving, damping, step)
            exceeding = moving & ((step < smallest_step) | (step > largest_step))
            if not exceeding.any():
                break
            step[exceeding] = np.clip(step, smallest_step, largest_step)[exceeding]
            moving &= ~exceeding
        return step


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to observations."""

    names: tuple[str, ...]
    """The effects of the model."""
    values: Array
    """Initial state and effect values, in the simulator's order."""
    free: NDArray[np.bool_]
    """Which values were fitted."""
    force_g: Array
    """Simulated, shape (n, 3)."""
    chi2: float
    """Sum over the samples that count."""
    normal: Array
    """Normal matrix of the free values, J^T J."""
    jacobian: Array
    """Derivatives of the simulation by all values, in sigma, shape (n, 3, values); of the last linearisation."""

    def covariance(self) -> Array:
        """Return the covariance of the free values under white noise; by the pseudo-inverse where some are not determined."""
        diagonal = np.diag(self.normal)
        scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        covariance: Array = np.linalg.pinv(self.normal / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
        return covariance


@dataclass(frozen=True, slots=True)
class FitProblem:
    """What stays the same during a fit: a model, a recording in segments, what is fitted, and who is told of it."""

    simulator: Simulator
    observations: Observations
    free: NDArray[np.bool_]
    """Which of the values of initial state and effects are fitted, shape (values,)."""
    first_samples: Sequence[int] = (0,)
    """Of the segments, or of the windows of a large swing."""
    tick: Callable[[], None] = lambda: None
    """Called before each simulation."""
    limits: Limits = field(default_factory=dict)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of all values, shape (values,) each."""
        bounds = [self.limits.get(each.label, (each.lower, each.upper)) for each in self.simulator.parameters]
        lower, upper = np.array(bounds, dtype=np.float64).T
        return lower, upper

    @property
    def as_one_segment(self) -> "FitProblem":
        """The same without segments."""
        return replace(self, first_samples=(0,))


SEGMENT_S = 30.0
CONTINUITY_TOLERANCE = 1e-3
"""Discontinuities, rad and rad/s, below which one segment replaces several: it is as linear, and quicker to simulate."""
MIN_RELATIVE_DECREASE = 1e-5
"""A fit has converged when a step lowers chi-square by less than this share."""
MIN_DECREASE = 0.05
"""A fit has converged when a step lowers chi-square by less than this, whatever the share."""
MIN_EXCESS_DECREASE = 1e-4
"""The same share of what chi-square has beyond noise: unexplained motion is correlated over ten samples and more, so that its
chi-square counts a tenth."""
JOIN_RELATIVE_DECREASE = 0.3
"""Segments are joined only after a step that lowers chi-square by less than this share."""
DAMPING_FACTORS = np.geomspace(1e-8, 10.0, 7)
"""Levenberg-Marquardt factors on the scaled diagonal, tried in turn until a step improves."""
INITIAL_DAMPING_LEVEL = 1
"""Position of the first factor that is tried. One small decrease after more damping does not show convergence."""
SETTLING_ITERATIONS = 2
"""Iterations after which the pace of a fit is representative. For as many, the times of events are held: before the initial state
is about right, the sensitivities to times that lie where nothing acts are zero."""


@dataclass(frozen=True, slots=True)
class CondensedSystem:
    """A linearised least-squares problem in the first initial state and the effect values, together the values."""

    residual: Array
    """In sigma, after the discontinuities are closed to first order, shape (n, 3)."""
    jacobian: Array
    """Derivatives by the values, in sigma, shape (n, 3, values)."""
    closing_step: Array
    """Step of the initial states that closes the discontinuities, shape (segments, states)."""
    states_by_values: Array
    """Derivatives of the initial states by the values, shape (segments, states, values)."""
    largest_discontinuity: float
    """Largest difference between the end of a segment and the initial state of the next, rad or rad/s."""


def condense(
    batch: SegmentBatch, observations: Observations, initial_states: Array, first_samples: Sequence[int]
) -> CondensedSystem:
    """Return the condensed system of a linearisation over segments that begin at `first_samples`."""
    n_states = initial_states.shape[1]
    n_values = n_states + batch.force_by_effects.shape[2]
    discontinuities = batch.ends[:-1] - initial_states[1:]
    discontinuities[:, HEADING] = (discontinuities[:, HEADING] + np.pi) % (2 * np.pi) - np.pi
    closing, by_values = np.zeros_like(initial_states), np.zeros((len(initial_states), n_states, n_values))
    by_values[0, :, :n_states] = np.eye(n_states)
    for i, discontinuity in enumerate(discontinuities):
        closing[i + 1] = batch.ends_by_start[i] @ closing[i] + discontinuity
        by_values[i + 1] = batch.ends_by_start[i] @ by_values[i]
        by_values[i + 1, :, n_states:] += batch.ends_by_effects[i]
    weight = observations.per_sigma
    residual = observations.residual_sigma(batch.force_g)
    jacobian = np.empty((len(residual), 3, n_values))
    for i, (first, last) in enumerate(pairwise([*first_samples, len(residual)])):
        by_state = batch.force_by_start[first:last].reshape(-1, n_states)  # one matrix product for all samples
        jacobian[first:last] = (by_state @ by_values[i]).reshape(-1, 3, n_values)
        residual[first:last] -= (by_state @ closing[i]).reshape(-1, 3) * weight[first:last]
    jacobian[..., n_states:] += batch.force_by_effects
    jacobian *= weight[..., None]
    return CondensedSystem(residual, jacobian, closing, by_values, float(np.abs(discontinuities).max(initial=0.0)))


def uniform_segments(observations: Observations, segment_s: float = SEGMENT_S) -> list[int]:
    """Return the first samples of segments of equal length, about `segment_s`."""
    count = max(1, round(observations.duration_s / segment_s))
    edges_s = np.linspace(0, observations.duration_s, count + 1)[:-1]
    return [int(i) for i in np.searchsorted(observations.time_s, edges_s)]


@np.errstate(over="ignore", invalid="ignore")  # a step to a trajectory that diverges is not taken
def fit_model(
    problem: FitProblem,
    initial_states: Array,
    effect_values: Array,
    iterations: int = FIT_ITERATIONS,
    give_up_above: float = np.inf,
) -> Fit:
    """Fit the free values from initial states (segments, states) and effect values (k,), until all segments are one.

    A large swing takes more iterations. The fit is abandoned when at its pace it would not come below the chi-square
    `give_up_above`. Raises `IntegrationError` where the initial guess cannot be simulated.
    """
    simulator, free = problem.simulator, problem.free
    if problem.observations.has_large_amplitude:
        iterations = max(iterations, LARGE_SWING_ITERATIONS)
    event_times = np.array([parameter.is_event_time for parameter in simulator.parameters])
    settling = SETTLING_ITERATIONS if (event_times & free).any() else 0
    current = _linearise(problem, initial_states, effect_values, problem.first_samples)
    level, was_small = INITIAL_DAMPING_LEVEL, False
    for remaining in range(settling + iterations, 0, -1):
        all_free = remaining <= iterations
        step = _take_step(problem, current, free if all_free else free & ~event_times, level)
        if step is None and all_free:
            break
        if step is None:
            level = INITIAL_DAMPING_LEVEL
            continue
        current, level = step.after, max(0, step.damping_level - 1)
        if (step.is_hopeless(remaining, give_up_above) and remaining <= iterations - SETTLING_ITERATIONS) or (
            step.has_converged(again=was_small) and all_free
        ):
            break
        was_small = step.is_small
        if step.may_join:
            current = _linearise(problem, current.initial_states[:1], current.effect_values, [0])
    return _result(problem, current)


@dataclass(frozen=True, slots=True)
class _Iterate:
    """A point of the iteration, linearised there."""

    initial_states: Array
    """Shape (segments, states)."""
    effect_values: Array
    """Shape (k,)."""
    first_samples: Sequence[int]
    system: CondensedSystem

    @property
    def chi2(self) -> float:
        """Chi-square after the discontinuities are closed to first order."""
        return float((self.system.residual**2).sum())

    @property
    def values(self) -> Array:
        """First initial state and effect values, shape (values,)."""
        return np.concatenate([self.initial_states[0], self.effect_values])

    @property
    def is_continuous(self) -> bool:
        """Whether the continuity constraints hold."""
        return self.system.largest_discontinuity < CONTINUITY_TOLERANCE


@dataclass(frozen=True, slots=True)
class _Step:
    """A step that was taken."""

    before: _Iterate
    after: _Iterate
    damping_level: int
    n_values: int
    """Number of values of the recording: the chi-square of noise."""

    @property
    def decrease(self) -> float:
        """By how much chi-square fell."""
        return self.before.chi2 - self.after.chi2

    @property
    def is_small(self) -> bool:
        """Whether the step lowered chi-square by next to nothing."""
        excess = self.after.chi2 - self.n_values
        least = max(MIN_DECREASE, MIN_RELATIVE_DECREASE * self.after.chi2, MIN_EXCESS_DECREASE * excess)
        return self.before.is_continuous and self.decrease < least

    def has_converged(self, *, again: bool) -> bool:
        """Whether the step was small, and so without much damping or `again`, as the one before."""
        return self.is_small and (again or self.damping_level <= INITIAL_DAMPING_LEVEL)

    @property
    def may_join(self) -> bool:
        """Whether one segment can replace several."""
        settled = self.decrease < JOIN_RELATIVE_DECREASE * self.after.chi2
        return len(self.after.initial_states) > 1 and self.after.is_continuous and settled

    def is_hopeless(self, remaining: int, give_up_above: float) -> bool:
        """Whether so many more steps of this size would leave chi-square above `give_up_above`."""
        return self.before.is_continuous and self.after.chi2 - remaining * max(self.decrease, 0.0) > give_up_above


def _linearise(
    problem: FitProblem, initial_states: Array, effect_values: Array, first_samples: Sequence[int]
) -> _Iterate:
    """Return an iterate. Raises `IntegrationError` where it cannot be simulated, or diverges."""
    o = problem.observations
    batch = problem.simulator.linearise_segments(
        initial_states, effect_values, o.time_s, first_samples, o.temperature_c
    )
    if not batch.is_finite:
        raise IntegrationError("the trajectory diverges from these values")
    system = condense(batch, o, initial_states, first_samples)
    return _Iterate(initial_states, effect_values, first_samples, system)


def _take_step(problem: FitProblem, current: _Iterate, free: NDArray[np.bool_], damping_level: int) -> _Step | None:
    """Return a step of the free values, with the least damping from this level on that improves; None where none does."""
    equations = NormalEquations.from_jacobian(current.system.jacobian, current.system.residual)
    lower, upper = problem.bounds
    step_limit = np.array([each.step_limit for each in problem.simulator.parameters])
    smallest = np.maximum(lower - current.values, -step_limit)
    largest = np.minimum(upper - current.values, step_limit)
    for level in range(damping_level, len(DAMPING_FACTORS)):
        problem.tick()
        after = _after(problem, current, equations.bounded_step(free, smallest, largest, DAMPING_FACTORS[level]))
        if after is not None and _improves(current, after):
            return _Step(current, after, level, problem.observations.n_values)
    return None


def _after(problem: FitProblem, current: _Iterate, step: Array) -> _Iterate | None:
    """Return the iterate after a step; None where it cannot be simulated, or where one segment fits no better."""
    initial_states = current.initial_states + current.system.closing_step + current.system.states_by_values @ step
    effect_values = current.effect_values + step[initial_states.shape[1] :]
    try:
        # With one segment a prediction, several times quicker than a linearisation, already shows chi-square.
        if len(initial_states) == 1:
            force_g = _simulate(problem, initial_states[0], effect_values)
            if problem.observations.chi2(force_g) >= current.chi2:
                return None
        return _linearise(problem, initial_states, effect_values, current.first_samples)
    except IntegrationError:
        return None


def _simulate(problem: FitProblem, initial_state: Array, effect_values: Array) -> Array:
    o = problem.observations
    values = np.concatenate([initial_state, effect_values])
    return problem.simulator.predict(values, o.time_s, o.temperature_c)


def _result(problem: FitProblem, current: _Iterate) -> Fit:
    """Return the fit as one trajectory from the first initial state."""
    force_g = _simulate(problem, current.initial_states[0], current.effect_values)
    free, jacobian, names = problem.free, current.system.jacobian, problem.simulator.effect_names
    flat = jacobian[..., free].reshape(-1, int(free.sum()))
    return Fit(names, current.values, free, force_g, problem.observations.chi2(force_g), flat.T @ flat, jacobian)


def _improves(before: _Iterate, after: _Iterate) -> bool:
    """Return whether a step lowers chi-square, or halves the discontinuities."""
    discontinuity = before.system.largest_discontinuity
    closes = discontinuity > CONTINUITY_TOLERANCE and after.system.largest_discontinuity < discontinuity / 2
    return after.chi2 < before.chi2 or closes
