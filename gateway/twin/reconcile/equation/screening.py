"""Screening of the library: what each term could take off the residual, from few linearisations beside a fitted model.

A term is tried at frequencies, time constants and gaps that the residual suggests. A force or a motion of the pivot shows as a
line at its own frequency. A rotation of the housing or a changing stiffness multiplies the swing, so its lines stand on both
sides of the swing's: the product of residual and swing has the frequency itself.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import ZERO_PADDING, periodogram, refine_frequency
from gateway.twin.effects.parameter import Values
from gateway.twin.effects.term import HIGHEST_FREQUENCY_HZ, Term
from gateway.twin.effects.term_library import TERMS
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.residual import noise_floor
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.signatures import Signatures, compute_signatures

Array = NDArray[np.float64]
MAX_FREQUENCIES = 5
PEAKS_OF_A_SIGNAL = 3
"""Frequencies that each product may suggest."""
MIN_PERIODS = 1.4
"""Periods in the recording of the slowest frequency: fewer cannot be told from a drift."""
APART_CYCLES = 0.7
"""Cycles in the recording by which two frequencies differ."""
MIN_POWER_RATIO = 12.0
"""Power over the noise floor from which a peak is tried."""
SHAPE_SHARES = np.geomspace(0.03, 0.75, 5)
"""Time constants over the duration of the recording, half plays over the largest reading across the rope, and dead zones over the
largest displacement of the load."""
OVERTONES = 7
"""Multiples of the swing's frequency at which no periodic term is tried: what keeps time with the swing is made by the swing."""
MAX_WORK = 8e6
"""Derivatives of states and readings in linearisations at further frequencies: all of them on 120 s of a rope of 12 m."""
LINEAR_REACH = 0.5
"""Share of its range that a coefficient may start a fit at."""


def shape_choices(time_s: Array, residual: Array, simulated_g: Array, reach_m: float) -> dict[str, list[float]]:
    """Return values of the parameters that give terms their shape, by the parameter's name, the most likely first.

    `residual` (n, 3) in sigma is that of the model so far, `simulated_g` (n, 3) the readings of that model, `reach_m` the largest
    displacement of the load.
    """
    duration_s = float(time_s[-1] - time_s[0])
    across_g = simulated_g[:, :2] - simulated_g[:, :2].mean(axis=0)
    return {
        "frequency_hz": candidate_frequencies_hz(time_s, residual, across_g[:, 0] + 1j * across_g[:, 1]),
        "time_constant_s": (duration_s * SHAPE_SHARES).tolist(),
        "gap_g": (np.abs(across_g).max() * SHAPE_SHARES).tolist(),
        "dead_zone_m": (reach_m * SHAPE_SHARES).tolist(),
    }


def candidate_frequencies_hz(time_s: Array, residual: Array, swing: NDArray[np.complex128]) -> list[float]:
    """Return frequencies at which a periodic term may act, the most evident first, for readings x + i y of the swing (n,)."""
    duration_s = time_s[-1] - time_s[0]
    own_hz = _strongest_hz(time_s, swing)
    found: list[tuple[float, float]] = []
    for signal in _signals(residual, swing):
        frequency_hz, powers = periodogram(time_s, signal)
        power = powers.sum(axis=1)
        band = (frequency_hz > MIN_PERIODS / duration_s) & (frequency_hz < HIGHEST_FREQUENCY_HZ)
        cycles = np.abs(frequency_hz - own_hz * np.clip(np.round(frequency_hz / own_hz), 1, OVERTONES)) * duration_s
        ratio = np.where(band, power / noise_floor(power), 0.0)
        found += [(height, hz) for height, hz in _peaks(frequency_hz, ratio * (cycles > APART_CYCLES))]
    chosen: list[float] = []
    for _, hz in sorted(found, reverse=True):
        if all(abs(hz - other) > APART_CYCLES / duration_s for other in chosen):
            chosen.append(hz)
    return chosen[:MAX_FREQUENCIES]


def _strongest_hz(time_s: Array, swing: NDArray[np.complex128]) -> float:
    across = np.stack([swing.real, swing.imag], axis=1)
    frequency_hz, power = periodogram(time_s, across)
    return refine_frequency(time_s, across, float(frequency_hz[1:][np.argmax(power[1:].sum(axis=1))]))


def _signals(residual: Array, swing: NDArray[np.complex128]) -> list[Array]:
    """Return the residual, and its products with the swing and with the swing's rate, each (n, m)."""
    rate = np.gradient(swing)
    left = residual[:, 0] + 1j * residual[:, 1]
    products = [left * np.conj(each) / max(float(np.abs(each).std()), 1e-12) for each in (swing, rate)]
    parts = [part[:, None] for product in products for part in (product.real, product.imag)]
    return [residual, *parts]


def _peaks(frequency_hz: Array, ratio: Array) -> list[tuple[float, float]]:
    """Return ratio and frequency of the largest peaks that are evident."""
    largest = np.lib.stride_tricks.sliding_window_view(np.pad(ratio, ZERO_PADDING), 2 * ZERO_PADDING + 1).max(axis=1)
    at = np.flatnonzero((ratio == largest) & (ratio > MIN_POWER_RATIO))
    at = at[np.argsort(-ratio[at])][:PEAKS_OF_A_SIGNAL]
    return [(float(ratio[i]), float(frequency_hz[i])) for i in at]


@dataclass(frozen=True, slots=True)
class ScreenedTerm:
    """A term with the values that a linearisation gives it."""

    name: str
    values: Values
    gain: float
    """Chi-square that it would take off."""
    signature: Array
    """What it changes with these values, in sigma, what is fitted anyway projected out, shape (3 n,)."""

    @property
    def term(self) -> Term:
        """The term of the library."""
        return TERMS[self.name]

    @property
    def n_parameters(self) -> int:
        """Numbers that a fit determines."""
        return sum(p.size for p in self.term.parameters)


def screen_terms(setting: FitContext, parent: CandidateFit) -> list[ScreenedTerm]:
    """Return every term that the model does not have, each with its best frequency or time constant, in no order."""
    tried = [name for name in TERMS if name not in parent.values and name not in setting.model_effects]
    steady = [name for name in tried if not TERMS[name].shape_parameters]
    starts = setting.segment_starts(parent.values) if setting.large_amplitude else None
    best = {each.name: each for each in _screen(setting, parent, steady, {}, starts)}
    for shapes in _shapes(setting, parent, [name for name in tried if name not in steady]):
        for each in _screen(setting, parent, tuple(shapes), shapes, starts):
            if each.name not in best or each.gain > best[each.name].gain:
                best[each.name] = each
    return list(best.values())


def _shapes(setting: FitContext, parent: CandidateFit, names: Sequence[str]) -> list[dict[str, Values]]:
    """Return values of frequencies, time constants and gaps by term, one set for each linearisation."""
    log = setting.log
    reach_m = setting.rig.length_m * math.sin(min(log.amplitude_rad, math.pi / 2))
    choices = shape_choices(log.time_s, log.residual_sigma(parent.fit.force_g), parent.fit.force_g, reach_m)
    shape_of = {name: TERMS[name].shape_parameters[0].name for name in names}
    affordable = max(1, int(MAX_WORK / setting.work_per_evaluation({**parent.values, **{name: {} for name in names}})))
    return [
        {name: {shape: choices[shape][i]} for name, shape in shape_of.items() if i < len(choices[shape])}
        for i in range(min(affordable, max(len(each) for each in choices.values())))
    ]


def _screen(
    setting: FitContext,
    parent: CandidateFit,
    names: Sequence[str],
    shapes: Mapping[str, Values],
    segment_starts: Array | None,
) -> list[ScreenedTerm]:
    signatures = compute_signatures(setting, parent.fit, parent.values, names, shapes, segment_starts)
    return [_solve(name, signatures, shapes.get(name, {})) for name in names]


def _solve(name: str, signatures: Signatures, shape: Values) -> ScreenedTerm:
    columns = signatures.of[name]
    norms = np.linalg.norm(columns, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    solved = np.linalg.lstsq(columns / scale, signatures.residual, rcond=1e-6)[0] / scale
    fitted = columns @ solved
    values: dict[str, float | tuple[float, ...]] = {}
    place = 0
    for p in TERMS[name].parameters:
        part = solved[place : place + p.size]
        place += p.size
        if p.name in shape:
            values[p.name] = shape[p.name]
            continue
        kept = np.clip(part, LINEAR_REACH * p.lower, LINEAR_REACH * p.upper)
        values[p.name] = tuple(kept.tolist()) if p.components else float(kept[0])
    return ScreenedTerm(name, values, float(fitted @ signatures.residual), fitted)
