"""The law of what no effect explains: terms of a library, screened by linearisation and selected by evidence.

A term is tried at frequencies, time constants and gaps that the residual suggests. A force or a motion of the pivot shows as a
line at its own frequency. A rotation of the housing or a changing stiffness multiplies the swing, so its lines stand on both
sides of the swing's: the product of residual and swing has the frequency itself.

Each round screens the library by linearisations, fits the best few terms beside what the law has already, and keeps the one
with the most evidence on the log and the selection part if it is significant on the log, in coloured noise too, and lowers the
residual of the selection part; never by the test part.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import ZERO_PADDING, periodogram, refine_frequency
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Values
from gateway.twin.effects.term import HIGHEST_FREQUENCY_HZ
from gateway.twin.effects.terms import TERMS
from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_MARGIN
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.residual import noise_floor, noise_inflation_factor, warrants_another_effect
from gateway.twin.reconcile.search.candidates import (
    LITTLE_OF_GAP,
    MAX_EFFECTS,
    MOST_OF_GAP,
    VALIDATED_MARGIN,
    CandidateFit,
    CandidateTable,
)
from gateway.twin.reconcile.search.context import FitRequest, SearchContext
from gateway.twin.reconcile.search.signatures import Signatures, compute_signatures
from gateway.twin.reconcile.search.steps import MAX_SCORED
from gateway.twin.reconcile.search.validation import ValidationFit, Validator

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
MAX_SCREENING_WORK = 8e6
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
    def n_parameters(self) -> int:
        """Numbers that a fit determines."""
        return sum(p.size for p in TERMS[self.name].parameters)


def screen_terms(setting: FitContext, parent: CandidateFit) -> list[ScreenedTerm]:
    """Return every term that the model does not have, each with its best frequency or time constant, in no order."""
    tried = [name for name in TERMS if name not in parent.values and name not in setting.model_effects]
    steady = [name for name in tried if not TERMS[name].shape_parameters]
    starts = setting.segment_starts(parent.values) if setting.log.has_large_amplitude else None
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
    affordable = max(
        1, int(MAX_SCREENING_WORK / setting.work_per_evaluation({**parent.values, **{name: {} for name in names}}))
    )
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


MAX_WORK = 2.5e7
"""Derivatives of states and readings in fits after which nothing further is fitted, some 3 s on one core of a desk."""
MIN_GAIN_SHARE = 0.3
"""Gain of a term by linearisation over the largest of the round, below which it is not fitted."""
COLLINEAR_COSINE = 0.999
"""Cosine of two terms' signatures from which one may stand for the other."""


@dataclass(frozen=True, slots=True)
class FoundLaw:
    """A law beside the effects of a model, with what came near it."""

    base: CandidateFit
    """The model that the law is added to."""
    candidate: CandidateFit
    before: ValidationFit
    """Of the base on the selection part; it predicts the test part."""
    after: ValidationFit
    terms: tuple[str, ...]
    """In the order in which they were chosen."""
    alternatives: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """For each term others that describe the data nearly as well, the closest first."""
    signatures: dict[str, np.ndarray] = field(default_factory=dict)
    """What each term changes in the log, in sigma, the initial motion and the base projected out, shape (3 n,)."""
    noise_inflation: float = 1.0


def find_law(
    context: SearchContext, base: CandidateFit, validator: Validator, random: np.random.Generator
) -> FoundLaw | None:
    """Return the law of what a model leaves; None where no term describes it. The library must be registered."""
    before = validator.evaluate(base)
    law = FoundLaw(base, base, before, before, ())
    work = context.budget.work + MAX_WORK
    while len(law.terms) < MAX_EFFECTS and context.budget.work < work:
        table = CandidateTable(context.setting.log).with_fit(law.candidate)
        longer = _with_one_more(context, table, law, validator, random, work)
        if longer is None:
            break
        law = longer
        on_log = warrants_another_effect(context.setting.log, law.candidate.fit)
        if not (on_log or warrants_another_effect(validator.selection, law.after.fit)):
            break
    if not law.terms or min(_share_closed(base, law.candidate), _share_closed(before, law.after)) < MOST_OF_GAP:
        return None
    return law


def _with_one_more(
    context: SearchContext,
    table: CandidateTable,
    law: FoundLaw,
    validator: Validator,
    random: np.random.Generator,
    max_work: float,
) -> FoundLaw | None:
    """Return the law with the term of most evidence beside the base; None where none is significant.

    Fits end at `max_work`.
    """
    screened = sorted(screen_terms(context.setting, law.candidate), key=lambda each: -_score(each, context, law))
    largest = max((each.gain for each in screened), default=0.0)
    chosen = [each for each in screened if each.gain > MIN_GAIN_SHARE * largest][:MAX_SCORED]
    starts, give_up_above = context.segment_starts(law.candidate), 2 * law.candidate.fit.chi2
    requests = [
        FitRequest({**law.candidate.values, each.name: each.values}, starts, give_up_above=give_up_above)
        for each in chosen
    ]
    table = context.fit_in_turn(table, requests, lambda _table, _request: context.budget.work <= max_work).start_round()
    limit = table.bic(table.best) + VALIDATED_MARGIN
    fitted = [(each, table.get({*law.candidate.values, each.name})) for each in chosen]
    near_best = [
        (each, fit)
        for each, fit in fitted
        if fit is not None and table.bic(fit) < limit and table.is_significant(law.candidate, fit)
        if not pairs_loss_with_gain(fit, each.name) and not replaces_loss(fit, law.base)
    ]
    validator.evaluate_ahead(fit for _, fit in near_best)
    validated = ((each, fit, validator.evaluate(fit)) for each, fit in near_best)
    rivals = [(table.evidence(fit, found.fit.chi2), each, fit, found) for each, fit, found in validated]
    rivals.sort(key=lambda each: each[0])
    if not rivals or not _holds(law, rivals[0][3], validator, random):
        return None
    least, best, best_fit, validation = rivals[0]
    near = [each for evidence, each, *_ in rivals if evidence < least + MIN_EVIDENCE_MARGIN]
    near += [each for each in screened if _cosine(each, best) > COLLINEAR_COSINE]
    others = tuple(dict.fromkeys(each.name for each in near if each is not best))
    return replace(
        law,
        candidate=best_fit,
        after=validation,
        terms=(*law.terms, best.name),
        alternatives={**law.alternatives, best.name: others},
        signatures={**law.signatures, best.name: best.signature},
        noise_inflation=table.noise_inflation,
    )


def replaces_loss(fit: CandidateFit, base: CandidateFit) -> bool:
    """Return whether a law takes the place of a loss of its base: it describes what that leaves, or contradicts its name."""
    losses = [name for name in base.names if EFFECTS[name].dissipative]
    left, before = (np.array([_amplitude(each, name) for name in losses]) for each in (fit, base))
    return bool((left < LITTLE_OF_GAP * before).any())


def _amplitude(fit: CandidateFit, name: str) -> float:
    """Return the largest deviation of the parameters that say how strong an effect is."""
    amplitudes = [each for each in EFFECTS[name].parameters if each.is_amplitude]
    return max(
        (float(np.max(np.abs(np.subtract(fit.values[name][p.name], p.neutral)))) for p in amplitudes), default=0.0
    )


def pairs_loss_with_gain(fit: CandidateFit, term: str) -> bool:
    """Return whether a term feeds in what a loss beside it takes out: as one loss of another shape, each has a false size."""
    return TERMS[term].feeds_energy(fit.values[term]) and any(EFFECTS[name].dissipative for name in fit.names)


def _score(screened: ScreenedTerm, context: SearchContext, law: FoundLaw) -> float:
    """Gain of a linearisation over the noise inflation, less the penalty of its parameters."""
    log = context.setting.log
    residual = log.residual_sigma(law.candidate.fit.force_g)
    inflation = noise_inflation_factor(log.time_s, residual - screened.signature.reshape(residual.shape))
    return screened.gain / inflation - screened.n_parameters * math.log(log.n_values)


def _holds(law: FoundLaw, after: ValidationFit, validator: Validator, random: np.random.Generator) -> bool:
    """Whether a term describes the selection part, too."""
    return _share_closed(law.after, after) > LITTLE_OF_GAP and validator.is_improved(law.after, after, random)


def _share_closed(before: CandidateFit | ValidationFit, after: CandidateFit | ValidationFit) -> float:
    return (before.reduced_chi2 - after.reduced_chi2) / max(before.reduced_chi2 - 1, 1e-9)


def _cosine(first: ScreenedTerm, second: ScreenedTerm) -> float:
    norms = np.linalg.norm(first.signature) * np.linalg.norm(second.signature)
    return 0.0 if norms == 0 else float(abs(first.signature @ second.signature) / norms)
