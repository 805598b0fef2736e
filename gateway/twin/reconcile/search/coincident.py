"""Effects that coincide with another one as long as no length changes: statements beside it, or rivals where one does."""

from collections.abc import Iterable, Iterator

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Values
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext


def any_length_changes(names: Iterable[str]) -> bool:
    """Whether one of these effects changes the rope's length, which separates effects that coincide otherwise."""
    return any(EFFECTS[name].changes_length for name in names)


def coincident_effects(model: EffectValues, length_m: float) -> Iterator[tuple[str, str, Values]]:
    """Yield effects that can give the same samples as one of a model: their names, its name, and their parameters."""
    for name, effect in EFFECTS.items():
        of = effect.coincides_with
        if of is None or of not in model or name in model:
            continue
        values = effect.equivalent_values(model[of], length_m)
        if values is not None:
            yield name, of, values


def fit_coincident_effects(table: CandidateTable, context: SearchContext, best: CandidateFit) -> CandidateTable:
    """Fit coincident effects in place of those of the best set where a length changes."""
    setting = context.setting
    if not any_length_changes((*best.values, *setting.model_effects)):
        return table
    for name, of, values in coincident_effects(best.values, setting.rig.length_m):
        if of not in context.baseline_effects:
            table = context.fit(table, {**best.without(of), name: values}, context.segment_starts(best))
    return table
