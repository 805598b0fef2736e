"""Steps that fit persistent effects whose frequencies or limits are first found in the residual."""

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.parallel_fits import FitRequest
from gateway.twin.reconcile.search.persistent import baseline_of

MAX_REMAINDER_OF_SIMPLER = 0.5
"""Share of the gap that the simpler of two effects with the same period may leave for the other one to be fitted."""


def fit_guessed_effects(table: CandidateTable, context: SearchContext, parent: CandidateFit) -> CandidateTable:
    """Fit the effects beside a parent that are guessed from its residual, until one explains the log."""
    names = [name for name in EFFECTS.choose(is_guessed_from_residual=True) if table.get(parent.names | {name}) is None]
    for several in ([name for name in names if name != DoublePendulum.name], [DoublePendulum.name]):
        requests = [each for name in several for each in _requests(table, context, parent, name)]
        table = context.fit_in_turn(table, requests, lambda now, _: not now.is_explained)
    return table


def fit_bodies(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Fit a heavy rope, and a pivot that yields or holds before it slides, where the data show one: pairs imitate each."""
    if context.setting.large_amplitude:
        return table
    for name in EFFECTS.choose(structure=ModelStructure.HEAVY_ROPE):
        if not table.is_explained:
            table = _fit_beyond_its_equivalent(table, context, name)
    for structure in (ModelStructure.YIELDING_PIVOT, ModelStructure.PRESLIDING):
        for name in EFFECTS.choose(structure=structure):
            if not table.is_explained:
                table = _fit_guessed(table, context, baseline_of(table, context), name)
    return table


def _fit_beyond_its_equivalent(table: CandidateTable, context: SearchContext, name: str) -> CandidateTable:
    """Fit an effect that coincides with a simpler one where that closes most of the gap, or where the residual shows it."""
    setting, effect, base = context.setting, EFFECTS[name], baseline_of(table, context)
    of = effect.coincides_with or ""
    simpler = table.get(base.names | {of})
    nearest = base if simpler is None or simpler.fit.chi2 > base.fit.chi2 else simpler
    guesses = list(effect.initial_guesses(setting.guess_context(setting.log.force_g - nearest.fit.force_g)))
    if nearest is simpler and nearest.reduced_chi2 - 1 < MAX_REMAINDER_OF_SIMPLER * (base.reduced_chi2 - 1):
        same = effect.equivalent_values(nearest.values[of], setting.rig.length_m)
        guesses += [] if same is None else [same]
    return context.fit_in_turn(table, context.requests(table, base.values, name, guesses))


def _fit_guessed(table: CandidateTable, context: SearchContext, parent: CandidateFit, name: str) -> CandidateTable:
    return context.fit_in_turn(table, _requests(table, context, parent, name))


def _requests(table: CandidateTable, context: SearchContext, parent: CandidateFit, name: str) -> list[FitRequest]:
    setting = context.setting
    guesses = EFFECTS[name].initial_guesses(setting.guess_context(setting.log.force_g - parent.fit.force_g))
    return context.requests(table, parent.values, name, guesses)
