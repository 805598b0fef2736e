"""Screening of the library: what each term could take off the residual, from few linearisations beside a fitted model."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.parameter import Values
from gateway.twin.effects.term import Term
from gateway.twin.effects.term_library import TERMS
from gateway.twin.reconcile.equation.shapes import shape_choices
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.score_test import Signatures, compute_signatures

Array = NDArray[np.float64]
MAX_WORK = 8e6
"""Derivatives of states and readings in linearisations at further frequencies: all of them on 120 s of a rope of 12 m."""
LINEAR_REACH = 0.5
"""Share of its range that a coefficient may start a fit at."""


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
