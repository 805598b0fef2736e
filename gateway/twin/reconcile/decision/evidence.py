"""Candidate fits ranked by all evidence, BIC on the log and chi-square on the selection part, and the facts of a verdict."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import rests_at_edge
from gateway.twin.effects.sensor import SampleLoss
from gateway.twin.reconcile.residual import EXCESS_LINES, has_excess
from gateway.twin.reconcile.search.candidates import LITTLE_OF_GAP, VALIDATED_MARGIN, CandidateFit, CandidateTable
from gateway.twin.reconcile.search.changepoints import exclude_unmodelled_profiles
from gateway.twin.reconcile.search.search import SearchRun
from gateway.twin.reconcile.search.validation import ValidationFit, Validator

MAX_VALIDATED = 4
"""Sets of effects that are evaluated on the selection part."""
MIN_EVIDENCE_MARGIN = 12.0
"""Chi-square over the noise inflation below which one set is no better than another: odds of 400 to 1."""
MIN_EVIDENCE_AGAINST = 20.0
"""Evidence against a value that no part has, or of a difference that noise hides, from which it is no alternative."""
MIN_NECESSARY_RATIO = 7.0
"""Factor by which the absence of a necessary effect multiplies the excess that the set leaves. Basis: of 204 engine-made cases
two more have a wrong name at 5, and one is right less at 10."""


@dataclass(frozen=True, slots=True)
class RankedCandidate:
    """A set of effects with all its evidence."""

    candidate: CandidateFit
    validation: ValidationFit
    bic: float
    evidence_deficit: float
    """By how much its evidence is behind that of the best one; 0 for the best."""

    @property
    def names(self) -> frozenset[str]:
        """The set of effects."""
        return self.candidate.names


def rank_candidates(
    table: CandidateTable, best: CandidateFit, baseline: frozenset[str], validator: Validator
) -> tuple[list[RankedCandidate], RankedCandidate]:
    """Evaluate the sets near the best on the selection part; return them best first, and the baseline."""
    limit = table.bic(best) + VALIDATED_MARGIN
    near = [
        fit
        for fit in table.ranked()
        if baseline <= fit.names and table.bic(fit) < limit and not best.names <= fit.names
    ]

    def ranked(fit: CandidateFit) -> RankedCandidate:
        return RankedCandidate(fit, validator.evaluate(fit), table.bic(fit), 0.0)

    chosen = [best, *near[: MAX_VALIDATED - 1]]
    validator.evaluate_ahead([*chosen, table.fits[baseline]])
    found = [ranked(fit) for fit in chosen]
    evidence = {each.names: table.evidence(each.candidate, each.validation.fit.chi2) for each in found}
    least = min(evidence.values())
    found = [replace(each, evidence_deficit=evidence[each.names] - least) for each in found]
    return sorted(found, key=lambda each: each.evidence_deficit), ranked(table.fits[baseline])


def rivals_of(ranked: list[RankedCandidate]) -> list[RankedCandidate]:
    """The best set and all sets whose evidence is too close to its to decide between them."""
    return [each for each in ranked if each.evidence_deficit < MIN_EVIDENCE_MARGIN]


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


def gather_evidence(
    run: SearchRun,
    ranked: list[RankedCandidate],
    baseline: RankedCandidate,
    *,
    improves_selection: bool,
    beyond_parts: frozenset[str],
) -> Evidence:
    """Compute the facts. Samples in events whose exact course is not modelled count for no residual."""
    best, fits = ranked[0], run.table.fits
    recordings = (run.recordings.log, run.validator.selection)
    seen_log, seen_selection = (exclude_unmodelled_profiles(each, best.candidate.values) for each in recordings)
    return Evidence(
        best=best,
        baseline=baseline,
        rivals=rivals_of(ranked),
        detected=frozenset() if run.lost_fraction is None else frozenset({SampleLoss.name}),
        improves_selection=improves_selection,
        best_leaves_excess=has_excess(seen_log, best.candidate.fit) or has_excess(seen_selection, best.validation.fit),
        baseline_leaves_excess=has_excess(seen_log, baseline.candidate.fit),
        necessary=_necessary_effects(best, baseline, fits),
        baseline_closes_gap=_baseline_closes_gap(baseline.candidate, fits),
        share_closed=_share_closed(run, best, baseline),
        beyond_parts=beyond_parts,
        at_edge=frozenset(
            name
            for name, values in best.candidate.values.items()
            if any(rests_at_edge(p, values[p.name]) for p in EFFECTS[name].parameters if p.name in values)
        ),
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


def _baseline_closes_gap(baseline: CandidateFit, fits: Mapping[frozenset[str], CandidateFit]) -> bool:
    nominal = fits.get(frozenset())
    if nominal is None or not baseline.names:
        return bool(baseline.names)
    closed = nominal.reduced_chi2 - baseline.reduced_chi2
    return closed > LITTLE_OF_GAP * max(nominal.reduced_chi2 - 1, EXCESS_LINES)


def _share_closed(run: SearchRun, best: RankedCandidate, baseline: RankedCandidate) -> float:
    """Return the share of the baseline's gap that is closed, or of the nominal model's where the baseline has a length."""
    start, validation = baseline.candidate, baseline.validation
    if baseline.names & set(EFFECTS.choose(is_usual=True)):
        start, validation = run.nominal, run.validator.evaluate(run.nominal)
    gaps = (start.reduced_chi2, best.candidate.reduced_chi2), (validation.reduced_chi2, best.validation.reduced_chi2)
    return min((before - after) / max(before - 1, EXCESS_LINES) for before, after in gaps)
