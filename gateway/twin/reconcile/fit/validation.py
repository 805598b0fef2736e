"""A model judged on a recording that it was not fitted to: only what belongs to the recording is fitted again."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import fit_sine_phasors
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.sensor import Vibration
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import is_world_directed, segment_bounds
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.initial_conditions import rotate_about_vertical, segment_initial_conditions
from gateway.twin.reconcile.fit.multiple_shooting import fit_model
from gateway.twin.reconcile.fit.windowed_fit import fit_trajectory
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
BLOCK_S = 6.0
"""Blocks as long as a swing: within them residuals go together."""
DRAWS = 500
HEADINGS = 6
NOISE, MORE_ROUNDS = 1.02, 15


@dataclass(frozen=True, slots=True)
class ValidationFit:
    """A model on the held-out recording."""

    fit: Fit
    reduced_chi2: float
    refitted_parameters: tuple[str, ...]


def evaluate_on_validation(
    rig: TwinRig, values: EffectValues, held_out: Observations, rounds: int = 10
) -> ValidationFit:
    """Fit initial motion, phases and, where directions of the world matter, the heading.

    Events count their time from the start of the recording: in a later piece of it they are earlier, or past.
    """
    values = {name: EFFECTS[name].shift_start(of_effect, held_out.offset_s) for name, of_effect in values.items()}
    simulator = Simulator(rig, sorted(values))
    free = np.array([slot.refitted for slot in simulator.parameters])
    free[HEADING] = is_world_directed(values)
    if Vibration.name in values:
        values = {
            **values,
            Vibration.name: {**values[Vibration.name], "phase_rad": _estimate_phase(rig, values, held_out)},
        }
    at = simulator.values([], values)[simulator.n_initial_states :]
    firsts = segment_bounds(rig, values, held_out)
    starts = segment_initial_conditions(simulator, held_out, at, firsts)
    best: Fit | None = None
    for heading_rad in np.arange(HEADINGS) * 2 * np.pi / HEADINGS if free[HEADING] else [0.0]:
        fit = fit_trajectory(
            simulator,
            held_out,
            rotate_about_vertical(starts, np.full(len(starts), heading_rad), simulator.structure),
            at,
            free,
            firsts,
            rounds,
        )
        if best is None or fit.chi2 < best.chi2:
            best = fit
        if best.chi2 < NOISE * held_out.n_values:
            break
    assert best is not None
    if best.chi2 > NOISE * held_out.n_values:  # a heading is slow to settle
        n = simulator.n_initial_states
        best = fit_model(simulator, held_out, best.values[None, :n], at, free, [0], MORE_ROUNDS)
    refitted = tuple(s.label for s, is_free in zip(simulator.parameters, free, strict=True) if is_free)
    return ValidationFit(best, best.chi2 / held_out.n_values, refitted)


def _estimate_phase(rig: TwinRig, values: EffectValues, held_out: Observations) -> float:
    """Phase of the line from the readings themselves: the swing is far below it."""
    vibration = values[Vibration.name]
    bend = np.diff(held_out.force_g, n=2, axis=0)  # the second difference weakens what is slow, and turns a sine over
    phasors = fit_sine_phasors(held_out.time_s[1:-1], -bend, float(np.asarray(vibration["frequency_hz"])))
    lags = np.concatenate([[0.0], np.atleast_1d(vibration.get("lag_rad", (0.0, 0.0)))])
    angle = np.angle((phasors * np.exp(1j * lags) * np.asarray(vibration["amplitude_g"])).sum()) + np.pi / 2
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def block_bootstrap_gain(
    before_sigma: Array, after_sigma: Array, time_s: Array, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of how much lower the reduced chi-square is after, from whole blocks drawn again; residuals (n, 3).

    Moving blocks, Künsch 1989: correlation within a block stays what it is.
    """
    gain = ((before_sigma**2) - (after_sigma**2)).mean(axis=1)
    length = max(1, int(np.searchsorted(time_s, BLOCK_S)))
    sums = np.convolve(gain, np.ones(length), mode="valid") / length
    count = max(1, len(gain) // length)
    means = sums[rng.integers(0, len(sums), (DRAWS, count))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)
