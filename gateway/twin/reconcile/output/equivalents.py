"""Effects that give the same samples, or the same period, as those of the answer."""

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.decision.verdict import Decision
from gateway.twin.reconcile.output.result import Equivalent
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.coincident import any_length_changes, coincident_effects
from gateway.twin.reconcile.search.context import SearchContext


def find_equivalents(
    decision: Decision, table: CandidateTable, context: SearchContext, base: CandidateFit
) -> tuple[Equivalent, ...]:
    """Return what coincides with named effects or candidates; nothing where a length changes: there they were rivals."""
    fitted = decision.model.candidate.values
    if any_length_changes((*fitted, *context.setting.model_effects)):
        return ()
    answer = {name: fitted[name] for name in (*decision.named, *decision.candidates) if name in fitted}
    for name in set(decision.candidates) - fitted.keys():
        alone = table.get({*base.names, name})
        answer |= {} if alone is None else {name: alone.values[name]}
    found = coincident_effects(answer, context.setting.rig.length_m)
    return tuple(
        Equivalent(name, of, values, EFFECTS[name].discriminating_experiment)
        for name, of, values in found
        if name not in context.setting.model_effects
    )
