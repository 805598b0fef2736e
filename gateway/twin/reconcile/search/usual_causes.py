"""The usual causes together: where nothing alone explains a recording, all that every rig has to some degree is fitted at once.

A real rig has an offset, a tilt, a length and losses of its own, none of which explains the recording without the others; a
search that adds one effect at a time stops at the first. So all of them are fitted under the prior of what parts and clamps
have, and those that the recording does not need are eliminated by their Wald statistics (Wald 1943).
"""

from dataclasses import replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Values
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.coloured_covariance import coloured_covariance
from gateway.twin.reconcile.residual.whiteness import EXCESS_SIGNIFICANT
from gateway.twin.reconcile.search.candidates import (
    MIN_SCORE_STATISTIC,
    SCORE_PENALTY_PER_PARAMETER,
    CandidateFit,
    CandidateTable,
)
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.stepwise_selection import eliminate
from gateway.twin.reconcile.search.validation_cache import Validator
from gateway.twin.simulator.simulator import Simulator

MAX_EXCESS_RATIO = 1.25
"""Excess of the usual causes over that of the best attempt up to which they are the better answer: an attempt has causes that few
rigs have, such as a steady wind where a mount is tilted."""


def fit_usual_causes(
    table: CandidateTable,
    context: SearchContext,
    best: CandidateFit,
    validator: Validator,
) -> tuple[CandidateTable, CandidateFit]:
    """Return the usual causes that the recording needs, where they leave hardly more than the best attempt on both parts.

    The table then has sets of usual causes alone: rivals of the answer are among them.
    """
    usual = set(EFFECTS.choose(is_usual=True)) - set(context.setting.model_effects)
    detected = set(context.baseline_effects)
    values = {name: best.values.get(name, EFFECTS[name].default_guess) for name in sorted(detected | usual)}
    found = _fit(table, context, values)
    if found is None:
        return table, best
    simulator, log = context.setting.simulator(tuple(values)), context.setting.log
    needed = sorted(necessary_names(found, simulator, log) | detected)
    found = _fit(table, context, {name: found.values[name] for name in needed})
    if found is None or not leaves_no_more(found.reduced_chi2, best.reduced_chi2):
        return table, best
    if not leaves_no_more(validator.evaluate(found).reduced_chi2, validator.evaluate(best).reduced_chi2):
        return table, best
    known = {names: fit for names, fit in table.fits.items() if names <= detected | usual}
    table = replace(table, fits=known, moves=()).with_fit(found).start_round()
    table, found = eliminate(table, context, found, held_by_parts=True)
    return table.record_move(table.fits[frozenset(detected)], found), found


def leaves_no_more(found: float, best: float) -> bool:
    """Whether a reduced chi-square leaves as little as the best, or so little more that what is usual is the better answer."""
    return found - 1 < MAX_EXCESS_RATIO * max(best - 1, EXCESS_SIGNIFICANT)


def necessary_names(fit: CandidateFit, simulator: Simulator, log: Observations) -> set[str]:
    """Return the effects without which a fit would be significantly worse, by linearisation, the least significant first out."""
    free = np.flatnonzero(fit.fit.free)
    specs = [simulator.parameters[i] for i in free]
    deviation = np.array([fit.fit.values[i] - simulator.parameters[i].neutral for i in free])
    covariance = coloured_covariance(fit.fit, log)
    left = set(fit.names)
    while left:
        statistics = {}
        for name in sorted(left):
            own = [i for i, spec in enumerate(specs) if spec.effect == name]
            statistic = float(deviation[own] @ np.linalg.pinv(covariance[np.ix_(own, own)]) @ deviation[own])
            statistics[name] = statistic / (1 + SCORE_PENALTY_PER_PARAMETER * len(own))
        least = min(statistics, key=lambda name: statistics[name])
        if statistics[least] > MIN_SCORE_STATISTIC:
            break
        own = [i for i, spec in enumerate(specs) if spec.effect == least]
        gain = covariance[:, own] @ np.linalg.pinv(covariance[np.ix_(own, own)])
        deviation = deviation - gain @ deviation[own]
        covariance = covariance - gain @ covariance[own]
        left.remove(least)
    return left


def _fit(table: CandidateTable, context: SearchContext, values: dict[str, Values]) -> CandidateFit | None:
    return context.fit(CandidateTable(table.log), values, held_by_parts=True).get(values)
