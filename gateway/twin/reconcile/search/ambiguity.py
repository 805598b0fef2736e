"""What may stand in place of a set of effects that was found: usual causes, and effects of the same signature.

A real rig has an offset, a tilt, a length and losses of its own, none of which explains the recording without the others; a
search that adds one effect at a time stops at the first. So where nothing alone explains a recording, all of them are fitted at
once under the prior of what parts and clamps have, and those that the recording does not need are eliminated by their Wald
statistics (Wald 1943).
"""

from dataclasses import replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_AGAINST
from gateway.twin.reconcile.decision.identifiability import (
    Contributions,
    FittedRecording,
    find_contributions,
)
from gateway.twin.reconcile.fit.fit_context import FitContext, is_world_directed
from gateway.twin.reconcile.fit.intervals import coloured_covariance
from gateway.twin.reconcile.residual import EXCESS_SIGNIFICANT, excess_chi2
from gateway.twin.reconcile.search.candidates import (
    MIN_SCORE_STATISTIC,
    SCORE_PENALTY_PER_PARAMETER,
    CandidateFit,
    CandidateTable,
    implausibility,
)
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.search import eliminate
from gateway.twin.reconcile.search.signatures import scorable_effects
from gateway.twin.reconcile.search.validation import Validator

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
    usual, stated = set(EFFECTS.choose(is_usual=True)), context.setting.stated_effects
    detected = set(context.baseline_effects)
    start = {**stated, **best.values}
    values = {name: start.get(name, EFFECTS[name].default_guess) for name in sorted(detected | usual)}
    found = context.fit_apart(values, held_by_parts=True)
    if found is None:
        return table, best
    needed = sorted(necessary_names(found, context.setting) | detected)
    found = context.fit_apart({name: found.values[name] for name in needed}, held_by_parts=True)
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


def necessary_names(fit: CandidateFit, setting: FitContext) -> set[str]:
    """Return the effects without which a fit would be significantly worse, by linearisation, the least significant first out."""
    simulator, free = setting.simulator(fit.names), np.flatnonzero(fit.fit.free)
    specs = [simulator.parameters[i] for i in free]
    deviation = (fit.fit.values - setting.nominal_values(simulator))[free]
    covariance = coloured_covariance(fit.fit, setting.log)
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


def contributions(context: SearchContext, validator: Validator, best: CandidateFit) -> Contributions:
    """What the effects of a fitted set contribute to the log and to the selection part together."""
    setting, n = context.setting, context.setting.simulator(best.names).n_initial_states
    validation = validator.evaluate(best)
    recordings = (
        FittedRecording(
            setting.log,
            {**setting.model_effects, **best.crane_inputs},
            best.fit.values[:n],
            heading_is_fitted=False,
            excess_chi2=excess_chi2(setting.log, best.fit),
        ),
        FittedRecording(
            validator.selection,
            validator.effects_of(best),
            validation.fit.values[:n],
            heading_is_fitted=is_world_directed({*best.names, *setting.model_effects}),
            excess_chi2=excess_chi2(validator.selection, validation.fit),
        ),
    )
    return find_contributions(setting.rig, setting.stated_effects, best.values, scorable_effects(setting), recordings)


def replace_implausible(
    table: CandidateTable, context: SearchContext, validator: Validator, best: CandidateFit
) -> tuple[CandidateTable, CandidateFit]:
    """Return the set with effects of the same signature in place of those that need a value no part has.

    Where a remainder makes two effects alike, what their fits leave decides nothing between them, and the prior does. The sets
    with such a value are then no rivals.
    """
    for name in sorted(best.names - set(context.baseline_effects)):
        if not is_beyond_parts(name, best, context):
            continue
        rest = best.without(name)
        starts = context.segment_starts(best)
        partners = sorted(contributions(context, validator, best).alike(name))
        for other in partners:
            requests = context.requests(table, rest, other, context.guesses(other, best), starts)
            table = context.fit_in_turn(table, requests)
        fits = (table.get({*rest, other}) for other in partners)
        alike = [fit for fit in fits if fit is not None and leaves_no_more(fit.reduced_chi2, best.reduced_chi2)]
        if alike:
            kept = {
                names: fit
                for names, fit in table.fits.items()
                if name not in names or not is_beyond_parts(name, fit, context)
            }
            moves = tuple(move for move in table.moves if move.names in kept)
            table, replaced = replace(table, fits=kept, moves=moves), best
            best = min(alike, key=table.bic)
            table = table.record_move(replaced, best)
    return table, best


def is_beyond_parts(name: str, fit: CandidateFit, context: SearchContext) -> bool:
    """Return whether an effect needs a value that no part has."""
    doubt = implausibility({name: fit.values[name]}, context.setting.rig)
    return doubt > MIN_EVIDENCE_AGAINST
