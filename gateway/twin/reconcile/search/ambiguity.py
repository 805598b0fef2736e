"""Effects that could replace one of a fitted set on both recordings, and those that should: what no part has is replaced."""

from dataclasses import replace

from gateway.twin.effects.plausibility import implausibility
from gateway.twin.reconcile.decision.identifiability import FittedRecording, indistinguishable_from
from gateway.twin.reconcile.decision.ranking import MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE
from gateway.twin.reconcile.fit.fit_context import is_world_directed
from gateway.twin.reconcile.residual.whiteness import excess_chi2
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.score_test import scorable_effects
from gateway.twin.reconcile.search.usual_causes import leaves_no_more
from gateway.twin.reconcile.search.validation_cache import Validator


def indistinguishable(context: SearchContext, validator: Validator, best: CandidateFit, name: str) -> tuple[str, ...]:
    """Effects with the same signature as one of a fitted set, on the log and on the selection part together, by similarity."""
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
    model = {name: each for name, each in setting.model_effects.items() if name not in setting.crane_inputs}
    model |= best.values
    return indistinguishable_from(setting.rig, model, name, scorable_effects(setting), recordings)


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
        partners = sorted(indistinguishable(context, validator, best, name))
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
    return doubt > MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE
