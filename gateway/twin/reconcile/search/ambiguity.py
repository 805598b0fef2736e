"""Effects of the same signature that may stand in place of those of a set that was found."""

from dataclasses import replace

from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_AGAINST
from gateway.twin.reconcile.decision.identifiability import Contributions, FittedRecording, find_contributions
from gateway.twin.reconcile.fit.fit_context import is_world_directed
from gateway.twin.reconcile.residual import EXCESS_SIGNIFICANT, excess_chi2
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable, implausibility
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.signatures import scorable_effects
from gateway.twin.reconcile.search.validation import Validator

MAX_EXCESS_RATIO = 1.25
"""Excess over that of the best set up to which another one, whose values parts can have, is the better answer."""


def leaves_no_more(found: float, best: float) -> bool:
    """Whether a reduced chi-square leaves as little as the best, or so little more that what parts can have is better."""
    return found - 1 < MAX_EXCESS_RATIO * max(best - 1, EXCESS_SIGNIFICANT)


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
