"""Samples that were lost without a gap in the time stamps: how many before each sample, and the recording at its true times.

Each interval between two samples loses a whole number of samples with the probabilities of a geometric distribution. The most
likely path of their sum (Viterbi 1967) and the model are fitted in turn, from a clock whose rate is wrong by as much on average.
Where a machine shakes the housing, the phase of the vibration shows a lost sample where the swing alone does not.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import MIN_MACHINE_LINE_HZ, MachineLine, find_machine_line
from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.sensor import ClockDrift
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.validation import evaluate_on_validation
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
CLOCK_RATE = f"{ClockDrift.name}.relative"
MIN_LOST_FRACTION = 0.002
"""Smallest fraction of lost samples that is looked for: two in a minute at 20 Hz."""
MAX_ALTERNATIONS = 8
"""Alternations between the path and the model."""
MIN_IMPROVEMENT = 0.01
"""Share of chi-square that a further alternation must have taken off."""
SEARCH_SAMPLES = 12
"""Samples on either side of the estimated count among which the path is searched; the next path is searched around this one."""
MAX_CONSECUTIVE_LOSSES = 3
"""Largest number of samples lost in one place."""
MIN_EXPLAINED_SHARE = 0.8
"""Share of what a constant rate leaves beyond the noise that the path must explain."""
BLOCKS = 8
"""Parts of the recording whose losses are counted: in each are some swings, and a few losses."""
MAX_DISPERSION = 3.5
"""Variance of these counts over that of random losses, which exceeds it once in 1000. It is far larger where
the swing itself changes."""


@dataclass(frozen=True, slots=True)
class SampleLossFit:
    """The true times of a recording, and the effects that were fitted with them."""

    true_s: Array
    """Increasing from 0, shape (n,)."""
    fraction: float
    """Fraction of the samples that are lost."""
    others: EffectValues
    evidence: float
    """BIC: chi-square of the samples, minus twice the logarithm of the path's probability, and the cost of the free values."""

    def retimed(self, observations: Observations) -> Observations:
        """Return the recording at its true times."""
        return replace(observations, time_s=self.true_s)


def find_sample_loss(context: FitContext, clock_fits: Iterable[CandidateFit]) -> SampleLossFit | None:
    """Return the losses with the most evidence where the log, fitted with a clock error, shows some; else None."""

    def find(clock_fit: CandidateFit) -> SampleLossFit | None:
        fraction = -float(np.asarray(clock_fit.values[ClockDrift.name]["relative"]))
        others = clock_fit.without(ClockDrift.name)
        return _find(context.rig, context.log, fraction, others, lambda log: replace(context, log=log).fit(others))

    alone = [each for each in clock_fits if all(EFFECTS[name].structure is ModelStructure.ROPE for name in each.names)]
    return min(filter(None, map(find, alone)), key=lambda loss: loss.evidence, default=None)


def retime_validation(context: FitContext, loss: SampleLossFit, held_out: Observations) -> Observations:
    """Return the held-out recording at its own true times; unchanged where no samples are found to be lost in it."""
    model_effects = {**context.model_effects, **loss.others}
    with_clock = {**model_effects, ClockDrift.name: {"relative": -loss.fraction}}
    rate = ClockDrift.parameters[0]
    fit = evaluate_on_validation(context.rig, with_clock, held_out, {CLOCK_RATE: (rate.lower, rate.upper)}).fit
    clock = Simulator(context.rig, fit.names).effects(fit.values)[ClockDrift.name]
    fraction = -float(np.asarray(clock["relative"]))

    def refit(retimed: Observations) -> Fit:
        return evaluate_on_validation(context.rig, model_effects, retimed).fit

    found = _find(context.rig, held_out, fraction, {}, refit)
    return held_out if found is None else found.retimed(held_out)


def _find(
    rig: TwinRig,
    observations: Observations,
    fraction: float,
    others: EffectValues,
    refit: Callable[[Observations], Fit],
) -> SampleLossFit | None:
    """Return the losses, from a first estimate of their fraction; None where a constant rate explains the recording as well.

    `refit` fits the model to the recording at other times.
    """
    if fraction < MIN_LOST_FRACTION:
        return None
    o = observations
    count: Counts = np.rint(o.time_s * fraction / (1 - fraction) / o.interval_s).astype(np.int64)
    retimed = replace(o, time_s=o.time_s / (1 - fraction))
    try:
        fit = refit(retimed)
        line = _line_left(retimed, fit)
        constant_chi2 = chi2 = o.chi2(fit.force_g + _vibration_g(line, retimed.time_s))
        # A machine turns several times between two losses: the swing alone says about where they are.
        for by_swing_alone in (True, False):
            for _ in range(MAX_ALTERNATIONS):
                seen = replace(o, force_g=_without_vibration(o, fit)) if by_swing_alone else o
                count, cost = _most_likely_path(seen, rig, fit, None if by_swing_alone else line, count, fraction)
                fraction = float(count[-1] / (count[-1] + len(count)))
                retimed = replace(o, time_s=o.time_s + count * o.interval_s)
                fit = refit(retimed)
                line, before = _line_left(retimed, fit), chi2
                chi2 = o.chi2(fit.force_g + _vibration_g(line, retimed.time_s))
                if before - chi2 < MIN_IMPROVEMENT * chi2:
                    break
    except INTEGRATION_FAILURES:
        return None
    explained = chi2 - o.n_values < (1 - MIN_EXPLAINED_SHARE) * (constant_chi2 - o.n_values)
    if not (
        explained
        and chi2 + cost < constant_chi2
        and fraction > MIN_LOST_FRACTION
        and _dispersion(count) < MAX_DISPERSION
    ):
        return None
    evidence = chi2 + cost + int(fit.free.sum()) * math.log(o.n_values)
    fitted = Simulator(rig, fit.names).effects(fit.values)
    return SampleLossFit(retimed.time_s, fraction, {name: fitted[name] for name in others}, evidence)


def _dispersion(count: Counts) -> float:
    """Return the variance of the losses in parts of a recording over that of as many random ones."""
    edges = np.linspace(0, len(count) - 1, BLOCKS + 1).astype(int)
    lost, samples = np.diff(count[edges]), np.diff(edges)
    share = lost.sum() / (lost.sum() + samples.sum())
    expected = samples * share / (1 - share)
    return float(((lost - expected) ** 2 / (expected / (1 - share) + 1e-9)).sum() / (BLOCKS - 1))


def _line_left(observations: Observations, fit: Fit) -> MachineLine | None:
    return find_machine_line(observations.time_s, observations.force_g - fit.force_g, observations.noise_g)


def _without_vibration(observations: Observations, fit: Fit) -> Array:
    """Return the readings without what is faster in them than swings, beside a model that has the swing."""
    o = observations
    transform = np.fft.rfft(o.force_g - fit.force_g, axis=0)
    transform[np.fft.rfftfreq(len(o.time_s), o.interval_s) > MIN_MACHINE_LINE_HZ] = 0
    return fit.force_g + np.fft.irfft(transform, len(o.time_s), axis=0)


def _vibration_g(line: MachineLine | None, time_s: Array) -> Array:
    """Return what a machine's line adds at some times (...), shape (..., 3)."""
    if line is None:
        return np.zeros((*time_s.shape, 3))
    signal_g: Array = (line.phasors_g * np.exp(2j * np.pi * line.frequency_hz * time_s)[..., None]).real
    return signal_g


def _most_likely_path(
    observations: Observations, rig: TwinRig, fit: Fit, line: MachineLine | None, near: Counts, fraction: float
) -> tuple[Counts, float]:
    """Return the number of samples lost before each, near an estimate (n,), and minus twice the log of its probability.

    It counts from the first sample, wherever the model is in time.
    """
    o, interval_s = observations, observations.interval_s
    offsets, losses = np.arange(-SEARCH_SAMPLES, SEARCH_SAMPLES + 1), np.arange(MAX_CONSECUTIVE_LOSSES + 1)
    fraction = max(fraction, MIN_LOST_FRACTION)
    step_cost = -2 * np.log(np.where(losses == 0, 1 - fraction, fraction**losses))
    times_s = o.time_s[:, None] + (near[:, None] + offsets) * interval_s
    misfit = ((o.force_g[:, None] - _simulated_g(o, rig, fit, line, times_s)) / o.noise_g) ** 2
    misfit = misfit.sum(axis=2) * o.used[:, None]
    cost = misfit[0]  # any start: another time is another initial motion
    best_losses = np.zeros((len(near), len(offsets)), dtype=np.int64)
    for i in range(1, len(near)):
        # State s now was state s + shift - losses before: the search window moved by `shift`.
        shift = int(near[i] - near[i - 1])
        pad = np.full(MAX_CONSECUTIVE_LOSSES, np.inf), np.full(max(0, shift), np.inf)
        padded = np.concatenate([pad[0], cost, pad[1]])
        firsts = MAX_CONSECUTIVE_LOSSES + shift - losses
        tried = np.stack([padded[first : first + len(offsets)] for first in firsts]) + step_cost[:, None]
        best_losses[i] = np.argmin(tried, axis=0)
        cost = tried[best_losses[i], np.arange(len(offsets))] + misfit[i]
    state = int(np.argmin(cost))
    path = np.empty(len(near), dtype=np.int64)
    for i in range(len(near) - 1, -1, -1):
        path[i] = near[i] + offsets[state]
        if i:
            state = int(state + (near[i] - near[i - 1]) - best_losses[i, state])
    return path - path[0], float(step_cost[np.diff(path)].sum())


def _simulated_g(observations: Observations, rig: TwinRig, fit: Fit, line: MachineLine | None, times_s: Array) -> Array:
    """Return the readings at many times (n, m), shape (n, m, 3): on an even grid, straight between its points."""
    interval_s = observations.interval_s
    place = np.maximum(times_s / interval_s, 0.0)
    below = np.floor(place + 1e-6).astype(np.int64)
    grid_s: Array = np.arange(int(below.max()) + 2.0) * interval_s
    temperature_c = observations.temperature_c
    grid_c = None if temperature_c is None else np.interp(grid_s, observations.time_s, temperature_c)
    grid_g = Simulator(rig, fit.names).predict(fit.values, grid_s, grid_c)
    share = (place - below)[..., None]
    return grid_g[below] * (1 - share) + grid_g[below + 1] * share + _vibration_g(line, times_s)
