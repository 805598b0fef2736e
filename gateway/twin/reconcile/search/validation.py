"""Validation: models on the selection part of the held-out recording, to which they were not fitted, each once.

Only the nuisance parameters are fitted again.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import fit_sine_phasors
from gateway.twin.effects.guess_context import wrap_angle
from gateway.twin.effects.parameter import Values
from gateway.twin.effects.sensor import Vibration
from gateway.twin.model import EffectValues, TwinRig, shift_start
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import is_world_directed, refitted_parameters, segment_bounds
from gateway.twin.reconcile.fit.initial_conditions import rotate_about_vertical, segment_initial_conditions
from gateway.twin.reconcile.fit.multiple_shooting import (
    NO_LIMITS,
    REFINE_ITERATIONS,
    Fit,
    FitProblem,
    Limits,
    fit_model,
)
from gateway.twin.reconcile.search.candidates import MIN_VARIANCE_SHARE, CandidateFit
from gateway.twin.reconcile.search.context import run_in_processes, values_key
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
HEADING_GUESSES = 6
"""Number of headings, equally spaced, from which a fit is started: each is within 30 degrees of the true one."""
MAX_HEADINGS = 2
"""Headings from which a large swing is fitted as one trajectory, out of those that are compared in windows."""
EXPLAINED_REDUCED_CHI2 = 1.02
"""Reduced chi-square below which a fit explains the recording; two standard deviations of it for 20 000 values."""
BOOTSTRAP_BLOCK_S = 6.0
"""Length of a block: about a period, within which residuals are correlated."""
BOOTSTRAP_DRAWS = 500
"""Draws of the bootstrap; they give the ends of a 95 % interval to 3 % of its width."""


@dataclass(frozen=True, slots=True)
class ValidationFit:
    """A model on the validation recording."""

    fit: Fit
    reduced_chi2: float
    refitted_parameters: tuple[str, ...]
    """Labels of the nuisance parameters."""


def evaluate_on_validation(
    rig: TwinRig, values: EffectValues, held_out: Observations, limits: Limits = NO_LIMITS
) -> ValidationFit:
    """Fit initial conditions and phases, and the heading where an effect has a direction in the world.

    Times of events are shifted where the recording is a slice of another. Parameters with `limits` are fitted between them.
    """
    values = shift_start(values, held_out.offset_s)
    if Vibration.name in values:
        phase_rad = _estimate_phase_rad(values[Vibration.name], held_out)
        values = {**values, Vibration.name: {**values[Vibration.name], "phase_rad": phase_rad}}
    simulator = Simulator(rig, sorted(values))
    n_states = simulator.n_initial_states
    free = refitted_parameters(simulator, values, held_out.duration_s)
    free |= np.array([parameter.label in limits for parameter in simulator.parameters])
    free[HEADING] = is_world_directed(values)
    effect_values = simulator.values([], values)[n_states:]
    problem = FitProblem(simulator, held_out, free, segment_bounds(rig, values, held_out), limits=limits)
    best: Fit | None = None
    guesses: Iterable[Array] = _initial_guesses(problem, effect_values)
    if held_out.has_large_amplitude and free[HEADING]:
        guesses = _closest_in_windows(problem, guesses, effect_values)
    for initial_states in guesses:
        fit = fit_model(problem, initial_states, effect_values)
        if best is None or fit.chi2 < best.chi2:
            best = fit
        if best.chi2 < EXPLAINED_REDUCED_CHI2 * held_out.n_values:
            break
    assert best is not None
    if best.chi2 > EXPLAINED_REDUCED_CHI2 * held_out.n_values:
        best = fit_model(problem.as_one_segment, best.values[None, :n_states], effect_values, REFINE_ITERATIONS)
    refitted = tuple(each.label for each, is_free in zip(simulator.parameters, free, strict=True) if is_free)
    return ValidationFit(best, best.chi2 / held_out.n_values, refitted)


def _initial_guesses(problem: FitProblem, effect_values: Array) -> Iterator[Array]:
    """Yield initial states of the segments (segments, states), one for each heading where that is free."""
    simulator = problem.simulator
    initial_states = segment_initial_conditions(simulator, problem.observations, effect_values, problem.first_samples)
    for turn in range(HEADING_GUESSES if problem.free[HEADING] else 1):
        angle_rad = np.full(len(initial_states), 2 * np.pi * turn / HEADING_GUESSES)
        yield rotate_about_vertical(initial_states, angle_rad, simulator.structure)


def _closest_in_windows(problem: FitProblem, guesses: Iterable[Array], effect_values: Array) -> Sequence[Array]:
    """Return the guesses that the windows of a large swing follow best: one trajectory takes ten times as long."""
    o = problem.observations

    def chi2(initial_states: Array) -> float:
        found = problem.simulator.linearise_segments(
            initial_states, effect_values, o.time_s, problem.first_samples, o.temperature_c
        )
        return o.chi2(found.force_g)

    return sorted(guesses, key=chi2)[:MAX_HEADINGS]


def _estimate_phase_rad(vibration: Values, held_out: Observations) -> float:
    """Return the phase of a vibration from the second difference of the samples, in which the slow swing hardly shows."""
    second_difference_g = np.diff(held_out.force_g, n=2, axis=0)
    frequency_hz = float(np.asarray(vibration["frequency_hz"]))
    phasors = fit_sine_phasors(held_out.time_s[1:-1], -second_difference_g, frequency_hz)
    lags_rad = np.concatenate([[0.0], np.atleast_1d(vibration.get("lag_rad", (0.0, 0.0)))])
    angle_rad = np.angle((phasors * np.exp(1j * lags_rad) * np.asarray(vibration["amplitude_g"])).sum()) + np.pi / 2
    return float(wrap_angle(angle_rad))


def block_bootstrap_gain(
    before_sigma: Array, after_sigma: Array, interval_s: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the 95 % interval of the decrease of the reduced chi-square between two residuals (n, 3), in sigma.

    Their samples count as evenly spaced, by `interval_s`. Moving blocks keep the correlation within a block (Künsch 1989).
    """
    gain = ((before_sigma**2) - (after_sigma**2)).mean(axis=1)
    length = max(1, int(np.searchsorted(np.arange(len(gain)) * interval_s, BOOTSTRAP_BLOCK_S)))
    block_means = np.convolve(gain, np.ones(length), mode="valid") / length
    count = max(1, len(gain) // length)
    means = block_means[rng.integers(0, len(block_means), (BOOTSTRAP_DRAWS, count))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


@dataclass(slots=True)
class Validator:
    """Evaluates models on a recording and keeps the results."""

    rig: TwinRig
    model_effects: EffectValues
    """Effects that the model has already; they act beside every set that is evaluated."""
    selection: Observations
    processes: int = 1
    """Processes for models that are evaluated together."""
    _known: dict[tuple[object, ...], ValidationFit] = field(default_factory=dict)

    def evaluate(self, candidate: CandidateFit) -> ValidationFit:
        """Fit initial motion, phases and heading under a set of effects; everything else stays as it is."""
        key = values_key(self.effects_of(candidate))
        if key not in self._known:
            self._known[key] = self._fit(candidate)
        return self._known[key]

    def evaluate_ahead(self, candidates: Iterable[CandidateFit]) -> None:
        """Evaluate at once what is about to be asked for."""
        new = {values_key(self.effects_of(each)): each for each in candidates}
        new = {key: each for key, each in new.items() if key not in self._known}
        if min(self.processes, len(new)) > 1:
            fitted = run_in_processes([partial(self._fit, each) for each in new.values()], self.processes)
            self._known.update(zip(new, fitted, strict=False))

    def _fit(self, candidate: CandidateFit) -> ValidationFit:
        chosen, limits = self.effects_of(candidate), self.limits_of(candidate)
        return evaluate_on_validation(self.rig, chosen, self.selection, limits=limits)

    def is_improved(self, before: ValidationFit, after: ValidationFit, random: np.random.Generator) -> bool:
        """Return whether less remains on the recording, by more than chance and enough to matter."""
        used, residual_sigma = self.selection.used, self.selection.residual_sigma
        left_before, left_after = (residual_sigma(each.fit.force_g)[used] for each in (before, after))
        low, _ = block_bootstrap_gain(left_before, left_after, self.selection.interval_s, random)
        return low > 0 and before.reduced_chi2 - after.reduced_chi2 > MIN_VARIANCE_SHARE

    def limits_of(self, candidate: CandidateFit) -> Limits:
        """Return the bounds of the rope's length, where a hoist in the log has changed it."""
        return {
            label: each for label, each in candidate.length_limits.items() if label.split(".")[0] in self.model_effects
        }

    def effects_of(self, candidate: CandidateFit) -> EffectValues:
        """Return all effects of a model on the recording.

        Inputs of the crane that acted earlier in the same recording keep their corrections from the log.
        """
        inputs = {name: each for name, each in candidate.crane_inputs.items() if name in self.model_effects}
        return {**self.model_effects, **inputs, **candidate.values}
