"""The facts that a verdict rests on, each with a name."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.plausibility import rests_at_edge
from gateway.twin.reconcile.changepoints.changepoint_scan import exclude_unmodelled_profiles
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.ranking import RankedCandidate
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.residual.whiteness import EXCESS_LINES, has_excess, has_lines
from gateway.twin.reconcile.search.candidates import CandidateFit

MIN_NECESSARY_RATIO = 7.0
"""Factor by which the absence of a necessary effect multiplies the excess that the set leaves. Basis: of 204 engine-made cases
two more have a wrong name at 5, and one is right less at 10."""
MIN_CLOSED_BY_SAMPLES = 0.1
"""Share of the nominal model's gap that effects of the samples close to be an answer although the rest is not explained."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What is known of the ranked sets of effects."""

    best: RankedCandidate
    baseline: RankedCandidate
    rivals: list[RankedCandidate]
    """The best set and all that the evidence does not separate from it."""
    detected: frozenset[str]
    """Effects found without a model: they count as named."""
    improves_selection: bool
    """The best set leaves less than the baseline on the selection part, by more than chance."""
    best_leaves_excess: bool
    baseline_leaves_excess: bool
    """A residual larger than noise remains on the log or, of the best set, on the selection part."""
    best_leaves_lines: bool
    """Spectral lines remain although hardly more than noise is left."""
    necessary: frozenset[str]
    """Effects of the best set whose absence leaves a share of the gap open."""
    baseline_closes_gap: bool
    """The effects found without a search close a share of the gap of the nominal model; coarse steps alone close nothing."""
    share_closed: float
    """Share of the gap that the best set closes, on the log or on the selection part, where it is less."""
    beyond_parts: frozenset[str]
    """Effects of the best set that need a value no part has."""
    at_edge: frozenset[str]
    """Effects of the best set with a value at a bound, where the fit would go further."""

    @property
    def baseline_names(self) -> frozenset[str]:
        """Effects found without a search."""
        return self.baseline.names

    @property
    def n_added(self) -> int:
        """Effects of the best set beyond the baseline."""
        return len(self.best.names - self.baseline_names)


def gather_evidence(
    best: RankedCandidate,
    baseline: RankedCandidate,
    nominal: RankedCandidate,
    rivals: list[RankedCandidate],
    log: Observations,
    selection: Observations,
    fits: Mapping[frozenset[str], CandidateFit],
    detected: frozenset[str],
    *,
    improves_selection: bool,
    beyond_parts: frozenset[str],
) -> Evidence:
    """Compute the facts. Samples in events whose exact course is not modelled count for no residual."""
    seen_log, seen_selection = (exclude_unmodelled_profiles(each, best.candidate.values) for each in (log, selection))
    on_both: tuple[tuple[Observations, Fit], ...] = (
        (seen_log, best.candidate.fit),
        (seen_selection, best.validation.fit),
    )
    return Evidence(
        best=best,
        baseline=baseline,
        rivals=rivals,
        detected=detected,
        improves_selection=improves_selection,
        best_leaves_excess=any(has_excess(*each) for each in on_both),
        baseline_leaves_excess=has_excess(seen_log, baseline.candidate.fit),
        best_leaves_lines=any(has_lines(*each) for each in on_both),
        necessary=_necessary_effects(best, baseline, fits),
        baseline_closes_gap=_baseline_closes_gap(baseline.candidate, fits),
        share_closed=_share_closed(best, baseline, nominal),
        beyond_parts=beyond_parts,
        at_edge=_effects_at_edge(best),
    )


def _necessary_effects(
    best: RankedCandidate, baseline: RankedCandidate, fits: Mapping[frozenset[str], CandidateFit]
) -> frozenset[str]:
    """Return the effects without which much more is left: what is left at best is the measure, be it noise or misfit."""
    excess = max(best.candidate.reduced_chi2 - 1, EXCESS_LINES)
    found = set(baseline.names)
    for name in best.names - baseline.names:
        without = fits.get(best.names - {name})
        if without is None or without.reduced_chi2 - 1 > MIN_NECESSARY_RATIO * excess:
            found.add(name)
    return frozenset(found)


def _effects_at_edge(best: RankedCandidate) -> frozenset[str]:
    return frozenset(
        name
        for name, values in best.candidate.values.items()
        if any(rests_at_edge(each, values[each.name]) for each in EFFECTS[name].parameters if each.name in values)
    )


def _baseline_closes_gap(baseline: CandidateFit, fits: Mapping[frozenset[str], CandidateFit]) -> bool:
    nominal = fits.get(frozenset())
    if nominal is None or not baseline.names:
        return bool(baseline.names)
    closed = nominal.reduced_chi2 - baseline.reduced_chi2
    return closed > MIN_CLOSED_BY_SAMPLES * max(nominal.reduced_chi2 - 1, EXCESS_LINES)


def _share_closed(best: RankedCandidate, baseline: RankedCandidate, nominal: RankedCandidate) -> float:
    """Return the share of the baseline's gap that is closed, or of the nominal model's where the baseline has a length."""
    start = nominal if baseline.names & set(EFFECTS.choose(is_usual=True)) else baseline
    gaps = (
        (start.candidate.reduced_chi2, best.candidate.reduced_chi2),
        (start.validation.reduced_chi2, best.validation.reduced_chi2),
    )
    return min((before - after) / max(before - 1, EXCESS_LINES) for before, after in gaps)
